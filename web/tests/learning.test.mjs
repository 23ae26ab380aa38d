// Automatic calibration, from the registration of a rig to its confirmation.
import assert from "node:assert/strict";
import { test } from "node:test";
import { recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let work, service, chromium, rig;

started(async (made) => {
  ({ work, service, chromium } = made);
  rig = recordings(work);
});

/** Sends lines `from` to `to` of the healthy recording as a device does. */
function send(asset, from, to) {
  const [head, ...lines] = rig.healthy.trim().split("\n");
  const body = `${head}\n${lines.slice(from, to).join("\n")}\n`;
  return ask(service.url, "POST", `/assets/${asset}/telemetry?session=first`, body, "text/csv");
}

const panel = (view) => view.getByRole("region", { name: "Calibration", exact: true });

test("motion is gathered, a calibration offered and confirmed", async () => {
  await ask(service.url, "POST", "/assets", { name: "new" });
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/new`);
  await panel(view).getByText("Waiting for motion").waitFor();

  await send("new", 0, 3000);
  const bar = panel(view).getByRole("progressbar", { name: "Motion along x" });
  await panel(view)
    .getByText(/^2\d of 60 s$/)
    .first()
    .waitFor();
  const early = Number(await bar.getAttribute("value"));
  await send("new", 3000, 5000);
  await panel(view)
    .getByText(/^4\d of 60 s$/)
    .first()
    .waitFor();
  assert.ok(Number(await bar.getAttribute("value")) > early, "the bar follows");

  await send("new", 5000, 7000);
  await view.getByRole("heading", { name: "Was the rig healthy while it was recorded?" }).waitFor();
  await panel(view).getByRole("link", { name: "first" }).waitFor();
  const step = await page(chromium);
  await step.goto(`${service.url}/rigs/new/set-up?step=learn`);
  await step.getByText(/A calibration is ready/).waitFor();
  await step.done();
  const drift = view.locator("#drift");
  await drift.getByText("no trends before the rig is calibrated").waitFor();
  await panel(view).getByRole("button", { name: "Yes, use this calibration" }).click();
  await view.getByRole("heading", { name: "Calibrated automatically" }).waitFor();
  await panel(view)
    .getByText(/Calibrated from 1 session; further healthy sessions refine it until it is based on 5/)
    .waitFor();
  await drift.getByText("0 of 6 sessions so far").waitFor();
  const { calibration } = await ask(service.url, "GET", "/assets/new");
  assert.ok(
    Math.abs(calibration.x.gain - rig.learnt.calibration.x.gain) < 0.05,
    "as in the manual calibration",
  );
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a rejected calibration starts again", async () => {
  await ask(service.url, "POST", "/assets", { name: "odd" });
  await send("odd", 0, 7000);
  const view = await page(chromium);
  await view.goto(service.url);
  await view.getByRole("link", { name: /odd.*confirm calibration/ }).click();
  await panel(view).getByRole("button", { name: "No, start again" }).click();
  await view.getByRole("heading", { name: "This rig is not calibrated yet" }).waitFor();
  const learning = await ask(service.url, "GET", "/assets/odd/learning");
  assert.deepEqual([learning.state, learning.sessions], ["gathering", []]);
  assert.deepEqual(view.errors, []);
  await view.done();
});
