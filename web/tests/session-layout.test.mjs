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

test("on a phone the controls of the playback are directly below the ball", async () => {
  const session = await imported(service.url, "bench", "phone", rig.sick);
  const view = await page(chromium, { viewport: { width: 390, height: 844 } });
  await view.goto(`${service.url}/sessions/${session.id}`);
  const [ball, verdict] = [view.locator("canvas").first(), view.locator(".verdict").first()];
  const slider = view.getByRole("slider", { name: "Moment" });
  for (const part of [ball, verdict, slider]) await part.waitFor();
  const [top, found, controls] = [ball, verdict, slider].map((part) => part.boundingBox());
  const [{ y }, verdictBox, sliderBox] = await Promise.all([top, found, controls]);
  assert.ok(verdictBox.y < y, `the verdict is at ${verdictBox.y}, the ball at ${y}`);
  assert.ok(sliderBox.y > y && sliderBox.y + sliderBox.height - y < 600, `${y} and ${sliderBox.y}`);
  await view.done();
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
