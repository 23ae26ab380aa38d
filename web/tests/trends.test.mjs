// Drift warnings: a servo that weakens from session to session.
import assert from "node:assert/strict";
import { test } from "node:test";
import { drifting, recordings } from "./rigs.mjs";
import { page, started } from "./support.mjs";

let work, service, chromium;

started(async (made) => {
  ({ work, service, chromium } = made);
  await drifting(service.url, work, recordings(work).learnt);
});

test("the fleet warns of a drifting servo, and the rig's page shows its trend", async () => {
  const view = await page(chromium);
  await view.goto(service.url);
  const row = view.getByRole("list", { name: "Rigs" }).getByRole("listitem").filter({ hasText: "weak" });
  await row.getByText("drifting").waitFor();
  await row.getByText(/fault in \d+ sessions/).waitFor();
  await view
    .getByRole("button", { name: /^Drifting/ })
    .getByText("1")
    .click();
  await row.getByRole("link").click();

  await view
    .getByRole("list", { name: "Drift warnings" })
    .getByText(/gain is .* and falls; at this slope it reaches/)
    .waitFor();
  const drift = view.locator("#drift");
  assert.equal(await drift.getByRole("img").count(), 6, "three parameters of two servos");
  const chart = drift.getByRole("img", { name: /Gain of the x servo over 12 sessions.*warning/ });
  assert.equal(await chart.locator("circle").count(), 12);
  assert.equal(await drift.getByText(/at the limit in \d+ sessions/).count(), 1);
  assert.deepEqual(view.errors, []);
  await view.done();
});
