// The set-up of a rig whose device sends millimetres with swapped axes and a wrong sign.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started, until } from "./support.mjs";

let work, service, chromium, rig;

started(async (made) => {
  ({ work, service, chromium } = made);
  rig = recordings(work);
});

/** The healthy recording as rows of a device with swapped axes, mm, and the sign of y inverted. */
function rows(from, to) {
  const number = (cell) => (cell === "" ? null : Number(cell));
  return rig.healthy
    .trim()
    .split("\n")
    .slice(1 + from, 1 + to)
    .map((line, i) => {
      const [t, qx, qy, x, y] = line.split(",").map(number);
      return {
        seq: from + i + 1,
        t_s: t,
        cmd_qx_rad: qx,
        cmd_qy_rad: qy,
        x_m: y === null ? null : -y * 1000,
        y_m: x === null ? null : x * 1000,
      };
    });
}

test("described, connected, corrected, learnt", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/set-up`);
  await view.getByLabel("Name").fill("bench 1");
  await view.getByRole("button", { name: "Register and continue" }).click();
  const isValid = () => view.getByLabel("Name").evaluate((field) => field.validity.valid);
  assert.equal(await isValid(), false, "a name with a blank is marked by the browser");
  assert.equal(await view.getByLabel("Name").getAttribute("title"), "Letters, digits, “-”, “_” and “.”");
  await view.getByLabel("Mass").fill("");
  await view.getByLabel("Mass").press("Enter");
  assert.equal(await view.getByLabel("Mass").evaluate((field) => field.validity.valid), false);
  assert.match(view.url(), /set-up$/, "nothing was registered");
  await view.getByLabel("Mass").fill("51");
  await view.getByText("Advanced").click();
  await view.getByLabel("Debounce time").fill("61");
  await view.getByText("Advanced").click();
  await view.getByLabel("Name").fill("bench-1");
  await view.getByLabel("Name").press("Enter");
  await view.getByLabel("Debounce time").waitFor();
  assert.match(view.url(), /set-up$/, "a value out of range is shown, though it was hidden");
  await view.getByLabel("Debounce time").fill("0.5");
  await view.getByLabel("Accepted false servo alarms").fill("12");
  await view.getByLabel("Ball's position").selectOption({ label: "mm" });
  assert.equal(await isValid(), true);
  await view.getByLabel("Mass").press("Enter");
  await view.getByText("Waiting for the first sample").waitFor();
  const { diagnostics } = await ask(service.url, "GET", "/assets/bench-1");
  assert.deepEqual([diagnostics.debounce_s, diagnostics.false_alarms_per_rig_year], [0.5, 12]);
  for (const word of ["curl", "Python", "Arduino / ESP32"]) {
    await view.getByRole("button", { name: word, exact: true }).click();
    await view.getByLabel(`${word} snippet`).getByText("mm", { exact: false }).first().waitFor();
    await view.getByLabel(`${word} snippet`).getByText("/api/v1/assets/bench-1/telemetry").first().waitFor();
  }
  const send = (from, to) =>
    ask(service.url, "POST", "/assets/bench-1/telemetry", { samples: rows(from, to) });
  await send(0, 20);
  await view.getByText(/Receiving samples|Samples received/).waitFor();
  await view.getByRole("button", { name: "Check it" }).click();
  await view.getByRole("heading", { name: "Signs and units" }).waitFor();

  // A device sends while the page is open; the wrong axes are detected and corrected.
  let at = 20;
  const device = async (until) => {
    for (; at < 9000 && !(await until()); at += 50) await send(at, Math.min(at + 50, 9000));
  };
  await device(() => view.getByText("follows the other command").first().isVisible());
  await view.getByRole("button", { name: "Correct the axes" }).click();
  await view.getByText(/x and y swapped/).waitFor();
  const { axes } = await ask(service.url, "GET", "/assets/bench-1");
  assert.deepEqual([axes.swap, axes.x_sign, axes.y_sign, axes.position_unit_m], [true, 1, -1, 0.001]);
  await view.getByText("The session was ended here. A device that names no session").waitFor();
  // The next session is complete, however long the detection took.
  at = 0;
  await device(async () => (await view.getByText("moves as commanded").count()) === 2);
  await view.getByRole("button", { name: "Continue: calibrate the rig" }).click();

  await device(() => false);
  await view.getByText("recording", { exact: false }).first().waitFor();
  // The page may propose the session, and so tick the box, just before the click.
  const box = view.getByRole("checkbox").first();
  await until(async () => {
    if (!(await box.isChecked())) await box.click();
    return box.isChecked();
  });
  await view.getByRole("button", { name: /^(Calibrate|End the recording and calibrate)$/ }).click();
  await view.getByText("Used from the next session on.").waitFor();
  const learnt = await ask(service.url, "GET", "/assets/bench-1");
  assert.ok(
    Math.abs(learnt.calibration.x.gain - rig.learnt.calibration.x.gain) < 0.05,
    "as learnt from the plain recording",
  );
  await view
    .getByRole("cell", { name: `${learnt.calibration.x.gain.toFixed(3)}` })
    .first()
    .waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a name that is taken is refused in words for people", async () => {
  await ask(service.url, "POST", "/assets", { name: "taken" });
  const view = await page(chromium);
  await view.goto(`${service.url}/set-up`);
  await view.getByLabel("Name").fill("taken");
  await view.getByRole("button", { name: "Register and continue" }).click();
  await view.getByText("There is a rig of this name already").waitFor();
  assert.doesNotMatch(await view.textContent("main"), /\/api\/|asset/);
  await view.done();
});

test("a description that was changed is the one that is changed next", async () => {
  await ask(service.url, "POST", "/assets", { name: "twice" });
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/twice/set-up`);
  await view.getByLabel("Mass").fill("51");
  await view.getByRole("button", { name: "Save and continue" }).click();
  await view.getByText("Waiting for the first sample").waitFor();
  await view.getByRole("button", { name: "1. Describe" }).click();
  await view.getByLabel("Radius").fill("21");
  await view.getByRole("button", { name: "Save and continue" }).click();
  await view.getByText("Waiting for the first sample").waitFor();
  const { ball } = await ask(service.url, "GET", "/assets/twice");
  assert.deepEqual([ball.mass_kg, ball.radius_m], [0.051, 0.021]);
  // Meanwhile somebody else changes it.
  await view.getByRole("button", { name: "1. Describe" }).click();
  await ask(service.url, "PUT", "/assets/twice", { name: "twice", ball: { ...ball, mass_kg: 0.06 } });
  await view.getByLabel("Radius").fill("22");
  await view.getByRole("button", { name: "Save and continue" }).click();
  await view.getByText("Somebody has changed this since the page showed it").waitFor();
  const now = await ask(service.url, "GET", "/assets/twice");
  assert.deepEqual([now.ball.mass_kg, now.ball.radius_m], [0.06, 0.021]);
  await view.done();
});

test("a step that is opened while the description is saved stays open", async () => {
  await ask(service.url, "POST", "/assets", { name: "slow" });
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/slow/set-up`);
  await view.getByLabel("Mass").fill("51");
  let release;
  const held = new Promise((resolve) => (release = resolve));
  await view.route("**/assets/slow", async (route) => {
    if (route.request().method() === "PUT") await held;
    await route.continue();
  });
  await view.getByRole("button", { name: "Save and continue" }).click();
  await view.getByRole("button", { name: "4. Calibrate" }).click();
  const current = view.locator("li[aria-current=step]");
  await current.filter({ hasText: "Calibrate" }).waitFor();
  const isRead = (response) =>
    response.request().method() === "GET" && response.url().endsWith("/assets/slow");
  const read = view.waitForResponse(isRead);
  release();
  await (await read).finished();
  await view.evaluate(() => new Promise(requestAnimationFrame));
  assert.match(await current.textContent(), /Calibrate/);
  assert.equal((await ask(service.url, "GET", "/assets/slow")).ball.mass_kg, 0.051);
  await view.done();
});

test("a recording without motion is refused with a message", async () => {
  await ask(service.url, "POST", "/assets", { name: "still" });
  const lines = Array.from({ length: 3000 }, (_, i) => `${(i / 100).toFixed(2)},0,0,0.01,0.01`);
  const text = `t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n${lines.join("\n")}\n`;
  await imported(service.url, "still", "rest", text);
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/still/set-up?step=learn`);
  await view.getByRole("checkbox").first().check();
  await view.getByRole("button", { name: /^(Calibrate|End the recording and calibrate)$/ }).click();
  await view.getByRole("alert").waitFor();
  assert.ok((await view.getByRole("alert").textContent()).length > 20);
  assert.deepEqual(view.errors, []);
  await view.done();
});
