// The page of a fault, and the reports of a session and of a fault, to print.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, offbd, page, started } from "./support.mjs";

let work, service, chromium, session;

started(async (made) => {
  ({ work, service, chromium } = made);
  const { learnt, sick } = recordings(work);
  await ask(service.url, "POST", "/assets", { ...learnt, name: "bench" });
  session = (await imported(service.url, "bench", "monday", sick)).id;
});

/** The number of pages on paper. */
async function pages(view) {
  const paper = (await view.pdf({ preferCSSPageSize: true })).toString("latin1");
  return paper.match(/\/Type\s*\/Page\b/g).length;
}

for (const [what, address, link] of [
  ["session", () => `/sessions/${session}`, "Report"],
  ["fault", () => "/rigs/bench/faults/x_servo", "Report to print"],
])
  test(`the report of a ${what} is one or two pages with verdict, picture and certificate`, async () => {
    const view = await page(chromium);
    await view.goto(service.url + address());
    await view.getByRole("link", { name: link, exact: true }).click();
    await view.waitForURL(/report$/);
    await view
      .getByText(/X servo/)
      .first()
      .waitFor();
    await view.getByRole("heading", { name: "Calibration and certificate" }).waitFor();
    await view.locator(".report canvas").first().waitFor();
    // On paper they are as large as on the screen.
    const widths = await view.locator(".report .u-wrap").evaluateAll((all) => all.map((e) => e.clientWidth));
    assert.equal(new Set(widths).size, 1, `as wide as each other: ${widths}`);
    await view
      .locator(".report-foot")
      .getByText(/offbd \d+\.\d+/)
      .waitFor();
    const n = await pages(view);
    assert.ok(n >= 1 && n <= 2, `${n} pages`);
    await view.emulateMedia({ media: "print" });
    assert.equal(await view.getByRole("button", { name: "Print" }).isVisible(), false);
    // The colours of the legend are printed too.
    const adjusted = view.locator(".report .u-wrap").first();
    assert.equal(await adjusted.evaluate((e) => getComputedStyle(e).printColorAdjust), "exact");
    assert.deepEqual(view.errors, []);
    await view.done();
  });

test("the report of a long session says that moments are left out", async () => {
  const long = join(work, "long.csv");
  offbd("simulate", "--seconds", "120", "-o", long);
  const { id } = await imported(service.url, "bench", "long", readFileSync(long, "utf8"));
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${id}/report`);
  await view.getByText("one of 2 judged moments is drawn").waitFor();
  await view.goto(`${service.url}/sessions/${session}/report`);
  await view.locator(".report canvas").first().waitFor();
  assert.equal(await view.getByText(/^Thinned/).count(), 0);
  await view.done();
});

test("the page of a fault draws what its monitor decided on, and zooms into it", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/bench/faults/x_servo`);
  await view.getByRole("img", { name: /^Evidence against the x servo/ }).waitFor();
  await view.getByRole("img", { name: /^Fault detection counter, x servo/ }).waitFor();
  await view.getByText(/A weight of evidence of [\d.]+\snats and more \(confirmed from/).waitFor();
  const chart = view.getByRole("img", { name: /^Residual along x/ });
  await chart.scrollIntoViewIfNeeded();
  const { x, y, width, height } = await chart.boundingBox();
  await view.mouse.move(x + width * 0.4, y + height / 2);
  await view.mouse.down();
  await view.mouse.move(x + width * 0.6, y + height / 2, { steps: 4 });
  await view.mouse.up();
  const zoom = view.getByRole("group", { name: "Zoom" });
  const [from, to] = (await zoom.textContent()).match(/[\d.]+/g).map(Number);
  assert.ok(to - from > 1 && to - from < 6, `${from} to ${to}`);
  await zoom.getByRole("button", { name: "Zoom out" }).click();
  await zoom.waitFor({ state: "detached" });
  await view.getByLabel("Monitor").selectOption({ label: "Position sensor" });
  await view.getByRole("img", { name: /^Fault detection counter, position sensor/ }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("the page of a fault says which curves are missing", async () => {
  const view = await page(chromium);
  const problem = { status: 413, json: { detail: "too many samples" } };
  await view.route("**/trace?*", (route) => route.fulfill(problem));
  await view.goto(`${service.url}/rigs/bench/faults/x_servo`);
  await view.getByText("shown is what was recorded. too many samples").waitFor();
  await view.getByText("on a servo was suspected is not known any more").waitFor();
  await view.getByRole("img", { name: /^Residual along x/ }).waitFor();
  assert.equal(await view.getByRole("img", { name: /^Evidence against/ }).count(), 0);
  await ask(service.url, "DELETE", `/sessions/${session}`);
  await view.reload();
  await view.getByText("is not stored any more, and its curves are gone").waitFor();
  assert.equal(await view.getByRole("link", { name: "Play the session back" }).count(), 0);
  await view.done();
});
