// Sessions that are judged again with another description of their rig.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let service, chromium, rig;

started(async (made) => {
  ({ service, chromium } = made);
  rig = recordings(made.work);
});

test("a session is judged again with the description that its rig has now", async () => {
  const wrong = { ...rig.learnt, name: "mended", calibration: null };
  await ask(service.url, "POST", "/assets", { ...wrong, ball: { ...wrong.ball, radius_m: 0.02 } });
  const session = await imported(service.url, "mended", "before", rig.sick);
  await ask(service.url, "PUT", "/assets/mended", { ...rig.learnt, name: "mended" });
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}`);
  await view.getByLabel("Profile").selectOption("");
  await view.getByRole("button", { name: "Judge again" }).click();
  await view.getByText("Identical verdict.").waitFor();
  await view.getByLabel("with the rig as described now").check();
  await view.getByRole("button", { name: "Judge again" }).click();
  // Only a calibrated rig has its servo faults confirmed.
  await view
    .locator(".verdicts dd")
    .getByText(/^X servo \(.*dead/)
    .waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
