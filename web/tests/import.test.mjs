// The dialogue for recordings that are dropped or chosen: long ones, foreign ones, and files that are none.
import assert from "node:assert/strict";
import { test } from "node:test";
import { recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let work, service, chromium, rig;

started(async (made) => {
  ({ work, service, chromium } = made);
  rig = recordings(work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
});

test("a long recording is shown in the dialogue and can be imported", async () => {
  const lines = rig.sick.trim().split("\n");
  const n = 70_000;
  const at = (i) => (0.01 * i).toFixed(2);
  const row = (i) => lines[1 + (i % (lines.length - 1))].split(",").slice(1);
  const text = [lines[0], ...Array.from({ length: n }, (_, i) => [at(i), ...row(i)].join(","))].join("\n");
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  const buffer = Buffer.from(text);
  await view.locator("input[type=file]").setInputFiles({ name: "long.csv", mimeType: "text/csv", buffer });
  const dialogue = view.getByRole("dialog");
  await dialogue.getByText("70\u202f000 rows over 700.0\u202fs").waitFor();
  await dialogue.getByLabel("Rig").fill("bench");
  assert.ok(await dialogue.getByRole("button", { name: /^Import 70\s000 rows/ }).isEnabled());
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a dropped file opens the dialogue; a file that is not a recording is refused", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await view.getByText("Drop a recording").waitFor();
  const drop = (name, text) =>
    view.evaluate(
      ([name, text]) => {
        const files = new DataTransfer();
        const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
        files.items.add(new File([bytes], name, { type: "text/csv" }));
        dispatchEvent(new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true }));
      },
      [name, text],
    );
  await drop("letter.csv", "Dear all,\nno recording.\nYours\n");
  await view.getByText("Choose the column of the time, or give the rows per second").waitFor();
  await view.keyboard.press("Escape");
  await view.getByRole("dialog").waitFor({ state: "detached" });
  await drop("picture.csv", "\x89PNG\r\n\x1a\n\0\0\0\rIHDR,\x02,\x01\n1,2,3\n4,5,6\n");
  await view.getByRole("alert").getByText("this is a picture, not a recording").waitFor();
  await view.keyboard.press("Escape");
  await view.getByRole("dialog").waitFor({ state: "detached" });

  // Nothing says which column is what: nothing can be imported, and no rig is registered.
  await drop("numbers.csv", "0,1,2\n0.01,1,2\n0.02,1,2\n");
  await view.getByRole("dialog").getByLabel("Rig").fill("stranger");
  await view.getByText("Choose the column of the time, or give the rows per second").waitFor();
  assert.ok(await view.getByRole("button", { name: /^Import 0 rows/ }).isDisabled());
  await view.keyboard.press("Escape");
  await view.getByRole("dialog").waitFor({ state: "detached" });
  await drop("dropped.csv", rig.sick);
  const dialogue = view.getByRole("dialog");
  await dialogue.getByLabel("Rig").fill("new-rig");
  await dialogue.getByText("There is no rig new-rig yet").waitFor();
  await dialogue.getByRole("button", { name: /^Import/ }).click();
  await view.getByRole("heading", { name: "dropped", exact: true }).waitFor();
  // The picture, which the service refuses.
  assert.deepEqual(
    view.errors.filter((error) => !/status of 400/.test(error)),
    [],
  );
  await view.done();
});

test("a recording as its owner has it is read by its guesses, once they are confirmed", async () => {
  const [head, ...lines] = rig.sick.trim().split("\n");
  assert.equal(head, "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m");
  const decimal = (value) => (value === "" ? "" : `${value}`.replace(".", ","));
  const row = (line) => {
    const [t, qx, qy, x, y] = line.split(",");
    const degrees = (rad) => (rad === "" ? "" : (Number(rad) * 180) / Math.PI);
    const centimetres = (m) => (m === "" ? "NA" : Number(m) * 100);
    const cells = [Math.round(Number(t) * 1000), degrees(qx), degrees(qy), centimetres(x), centimetres(y)];
    return cells.map(decimal).join(";");
  };
  const text = ["Prüfstand 3", "Zeit;Roll;Pitch;Ball X;Ball Y", ...lines.map(row)].join("\r\n");
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  const buffer = Buffer.from(text, "latin1");
  await view.locator("input[type=file]").setInputFiles({ name: "lab.csv", mimeType: "text/csv", buffer });
  const dialogue = view.getByRole("dialog");
  await dialogue.getByText("Windows-1252, separated by semicolons; decimal commas").waitFor();
  const chosen = (label) => dialogue.getByLabel(label, { exact: true }).inputValue();
  assert.equal(await chosen("Unit of Time"), "ms");
  assert.equal(await chosen("Unit of Ball x"), "cm");
  assert.equal(await chosen("Unit of Command qx (about x)"), "deg");
  // A wrong unit is doubted, and corrected with one click.
  await dialogue.getByLabel("Unit of Ball y").selectOption("mm");
  const correct = dialogue.getByRole("button", { name: "Take y_m = 'Ball Y'/cm" });
  await correct.click();
  await correct.waitFor({ state: "detached" });
  assert.equal(await chosen("Unit of Ball y"), "cm");
  await dialogue.getByLabel("Rig").fill("bench");
  await dialogue.getByLabel("Save this mapping for further files").check();
  await dialogue.getByRole("button", { name: /^Import [\d\s]+ rows/ }).click();
  await view.getByRole("heading", { name: "lab", exact: true }).waitFor();
  const { columns } = await ask(service.url, "GET", "/assets/bench");
  assert.match(columns, /^t_s=Zeit\/ms, .*y_m='Ball Y'\/cm$/);
  const { items } = await ask(service.url, "GET", "/sessions?asset=bench&name=lab");
  const verdict = items[0].verdict;
  await ask(service.url, "POST", "/assets/bench/sessions/import?name=own", rig.sick, "text/csv");
  const own = (await ask(service.url, "GET", "/sessions?asset=bench&name=own")).items[0].verdict;
  assert.deepEqual(verdict.faults, own.faults);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a recording of a known rig is imported while the list of rigs is still being read", async () => {
  const view = await page(chromium);
  let n = 0;
  // The first list does not arrive.
  await view.route("**/api/v1/fleet*", (route) => (n++ ? route.continue() : undefined));
  await view.goto(`${service.url}/sessions`);
  const buffer = Buffer.from(rig.healthy);
  await view.locator("input[type=file]").setInputFiles({ name: "early.csv", mimeType: "text/csv", buffer });
  const dialogue = view.getByRole("dialog");
  await dialogue.getByLabel("Rig").fill("bench");
  await dialogue.getByRole("button", { name: /^Import/ }).click();
  await view.getByRole("heading", { name: "early", exact: true }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
