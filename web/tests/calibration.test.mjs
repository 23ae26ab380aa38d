// The page with the calibrations of a rig.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { calibrated, imported, recordings } from "./rigs.mjs";
import { ask, offbd, page, started } from "./support.mjs";

let work, service, chromium, rig;

started(async (made) => {
  ({ work, service, chromium } = made);
  rig = recordings(work);
  await ask(service.url, "POST", "/assets", { name: "bench" });
  const session = await imported(service.url, "bench", "healthy", rig.healthy);
  for (let i = 0; i < 2; i++) await calibrated(service.url, "bench", session.id);
});

test("the calibrations are listed with their fit, and an earlier one is used again", async () => {
  // The rig may have learnt from its first session by itself as well.
  const n = (await ask(service.url, "GET", "/assets/bench/calibrations")).items.length;
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/bench`);
  await view.getByRole("link", { name: "Calibrations" }).click();
  await view.getByRole("heading", { name: `Values of calibration ${n}` }).waitFor();
  await view.getByRole("heading", { name: `Before: with calibration ${n - 1}` }).waitFor();

  await view.getByRole("radio", { name: "1" }).check();
  await view.getByRole("heading", { name: "Values of calibration 1" }).waitFor();
  await view.getByRole("heading", { name: "Before: without a calibration" }).waitFor();
  await view.getByText(/^Along x the residual is [\d.]+\sm\/s²/).waitFor();
  assert.equal(await view.getByRole("img", { name: /^Residual along/ }).count(), 4);
  assert.equal(await view.getByRole("img", { name: /^Acceleration along/ }).count(), 4);

  const first = view.getByRole("row", { name: /^1 / });
  await first.getByRole("button", { name: "Restore this calibration" }).click();
  const dialog = view.getByRole("dialog", { name: "Restore calibration 1?" });
  await dialog.getByRole("button", { name: "Restore this calibration" }).click();
  await view.getByRole("row", { name: /^1 .* in use since/ }).waitFor();
  const { items } = await ask(service.url, "GET", "/assets/bench/calibrations");
  assert.deepEqual(
    items.map(({ active }) => active),
    items.map((_, i) => i === n - 1),
  );
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("the fit over a long session says that moments are left out", async () => {
  const long = rig.path("long.csv");
  offbd("simulate", "--seconds", "400", "-o", long);
  await imported(service.url, "bench", "long", readFileSync(long, "utf8"));
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/bench/calibrations`);
  await view.getByLabel("Session").selectOption({ label: "long" });
  await view.getByText("one of 2 judged moments is drawn and counted").waitFor();
  await view.getByLabel("Session").selectOption({ label: "healthy" });
  await view.getByText(/^Thinned/).waitFor({ state: "detached" });
  await view.getByText(/^Along x the residual is/).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
