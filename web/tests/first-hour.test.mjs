// The first hour with recordings as their owners have them: from an empty store, imported with the mapping
// that is proposed or typed, calibrated, and a fault found.
import assert from "node:assert/strict";
import { test } from "node:test";
import { recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let service, chromium, rig;

started(async (made) => {
  ({ service, chromium } = made);
  rig = recordings(made.work);
});

const degrees = (rad) => (180 / Math.PI) * rad;
const radians = (deg) => (Math.PI / 180) * deg;

/** Writes a recording with other columns; a value that is missing is `missing`. */
function table(recording, head, separator, row, missing = "nan") {
  const [names, ...lines] = recording.trim().split("\n");
  assert.equal(names, "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m");
  const cells = (line) => row(...line.split(",").map((cell) => (cell === "" ? NaN : Number(cell))));
  const text = (value) => (Number.isNaN(value) ? missing : `${value}`);
  return [head, ...lines.map((line) => cells(line).map(text).join(separator))].join("\r\n");
}

/** Opens the dialogue for a file and chooses the rig. */
async function opened(view, name, text, asset) {
  await view.goto(`${service.url}/sessions`);
  const file = { name, mimeType: "text/plain", buffer: Buffer.from(text, "latin1") };
  await view.locator("input[type=file]").setInputFiles(file);
  const dialogue = view.getByRole("dialog");
  await dialogue.getByLabel("Rig", { exact: true }).fill(asset);
  return dialogue;
}

async function imported(view, dialogue, name) {
  await dialogue.getByRole("button", { name: /^Import [\d\s]+ rows/ }).click();
  await view.getByRole("heading", { name, exact: true }).waitFor();
}

/** Calibrates the rig from the session on the page, and returns its calibration. */
async function calibrated(view, asset) {
  await view.getByRole("link", { name: "Enter the dimensions of this rig" }).click();
  await view.getByRole("button", { name: "Save and continue" }).click();
  await view.getByRole("button", { name: "4. Calibrate" }).click();
  await view.getByRole("checkbox").first().waitFor();
  await view.getByRole("button", { name: "Calibrate", exact: true }).click();
  await view.getByText("Used from the next session on.").waitFor();
  return (await ask(service.url, "GET", `/assets/${asset}`)).calibration;
}

/** From a healthy recording to a fault in another one; `map` completes the mapping in the dialogue. */
async function firstHour(asset, file, map) {
  const view = await page(chromium);
  let dialogue = await opened(view, "monday.csv", file(rig.healthy), asset);
  await map?.(dialogue);
  await dialogue.getByLabel("Save this mapping for further files").check();
  await imported(view, dialogue, "monday");
  const { x } = await calibrated(view, asset);
  assert.ok(Math.abs(x.gain - rig.learnt.calibration.x.gain) < 0.05, `the gain is ${x.gain}`);
  // The mapping is known now; while the file is read by it, nothing can be imported.
  const read = view.waitForResponse(
    (answer) => /dry_run/.test(answer.url()) && answer.url().includes(`/${asset}/`),
  );
  dialogue = await opened(view, "tuesday.csv", file(rig.sick), asset);
  await read;
  await imported(view, dialogue, "tuesday");
  await view
    .getByText(/X servo.* confirmed/)
    .first()
    .waitFor();
  const { items } = await ask(service.url, "GET", `/sessions?asset=${asset}&name=tuesday`);
  assert.deepEqual(items[0].verdict.faults, ["x_servo"]);
  assert.deepEqual(view.errors, []);
  await view.done();
}

test("a plate whose file has degrees, centimetres and decimal commas", () =>
  firstHour("plate", (recording) =>
    table(recording, "Zeit [ms];Roll [°];Pitch [°];Ball X [cm];Ball Y [cm]", ";", (t, qx, qy, x, y) =>
      [Math.round(1000 * t), degrees(qx), degrees(qy), 100 * x, 100 * y].map((v) => `${v}`.replace(".", ",")),
    ),
  ));

test("a beam, whose file has one axis and seconds since 1970", () =>
  firstHour("beam", (recording) =>
    table(recording, "time,angle_deg,ball_mm", ",", (t, _qx, qy, x) => [
      (1771570260 + t).toFixed(3),
      degrees(qy).toFixed(4),
      (1000 * x).toFixed(3),
    ]),
  ));

test("three servos in degrees, and a ball in pixels", () => {
  const mapping = [
    "t_s=t",
    "cmd_qy_rad=a/deg*0.666666667-b/deg*0.333333333-c/deg*0.333333333",
    "cmd_qx_rad=b/deg*0.577350269-c/deg*0.577350269",
    "x_m=px*0.0005-0.16",
    "y_m=0.12-py*0.0005",
  ];
  const leg = (qx, qy, at) => (qy * Math.cos(radians(at)) + qx * Math.sin(radians(at))).toFixed(3);
  return firstHour(
    "legs",
    (recording) =>
      table(recording, "t a b c px py", " ", (t, qx, qy, x, y) => [
        t,
        ...[0, 120, 240].map((at) => leg(degrees(qx), degrees(qy), at)),
        Math.round((x + 0.16) / 0.0005),
        Math.round((0.12 - y) / 0.0005),
      ]),
    async (dialogue) => {
      await dialogue.getByText("Mapping as a text").click();
      await dialogue.getByLabel("Mapping of the columns").fill(mapping.join(", "));
    },
  );
});
