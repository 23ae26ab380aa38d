// What of a session is seen at once, without scrolling.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let service, chromium, rig;

started(async (made) => {
  ({ service, chromium } = made);
  rig = recordings(made.work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
});

test("the ball, the controls of the playback and the residual are seen together", async () => {
  const session = await imported(service.url, "bench", "sick", rig.sick);
  for (const viewport of [
    { width: 1440, height: 900 },
    { width: 820, height: 1180 },
  ]) {
    await areSeenTogether(session, viewport);
  }
});

async function areSeenTogether(session, viewport) {
  const view = await page(chromium, { viewport });
  await view.goto(`${service.url}/sessions/${session.id}`);
  const parts = [
    view.locator("canvas").first(),
    view.getByRole("slider", { name: "Moment" }),
    view.getByRole("img", { name: /^Residual along x/ }),
  ];
  for (const part of parts) {
    await part.waitFor();
    const { y, height } = await part.boundingBox();
    assert.ok(
      y >= 0 && y + height <= viewport.height,
      `${await part.getAttribute("aria-label")}: ${y} to ${y + height}`,
    );
  }
  await view.done();
}
