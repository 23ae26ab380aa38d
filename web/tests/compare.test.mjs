// The page that compares two sessions.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, offbd, page, started } from "./support.mjs";

let work, service, chromium, rig;

started(async (made) => {
  ({ work, service, chromium } = made);
  rig = recordings(work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
  for (const name of ["healthy", "sick"]) await imported(service.url, "bench", name, rig[name]);
});

test("two sessions of the list are compared on one time axis", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await view.getByText("Choose two sessions").waitFor();
  await view.getByLabel("Compare healthy").check();
  await view.getByLabel("Compare sick").check();
  await view.getByRole("link", { name: "Compare the two chosen sessions" }).click();
  await view.getByRole("heading", { name: "Compare sessions" }).waitFor();
  await view.getByRole("heading", { name: "healthy" }).waitFor();
  await view.getByRole("heading", { name: "sick" }).waitFor();
  assert.equal(await view.getByRole("heading", { name: "Verdict" }).count(), 2);
  assert.equal(await view.getByRole("img", { name: /^Residual along x/ }).count(), 2);
  await view.getByLabel("Shift second session by").fill("2.5");
  await view.waitForURL(/shift=2\.5/);
  await view.getByLabel("Axis").selectOption("y");
  assert.equal(await view.getByRole("img", { name: /^Residual along y/ }).count(), 2);
  // In one chart, the later curve goes beyond the earlier one.
  await view.getByLabel("Charts").selectOption("overlaid");
  const chart = view.getByRole("img", { name: /^Residual along y .* of healthy and of sick/ });
  await chart.locator("canvas").waitFor();
  assert.equal(await view.getByRole("img", { name: /^Residual along y/ }).count(), 1);
  await chart.hover({ position: { x: 300, y: 60 } });
  for (const name of ["healthy", "sick"])
    await view
      .locator(".key", { hasText: new RegExp(`^${name} [−\\d]`) })
      .first()
      .waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a recording of which moments are left out says so", async () => {
  const long = rig.path("long.csv");
  offbd("simulate", "--seconds", "400", "-o", long);
  const { id } = await imported(service.url, "bench", "long", readFileSync(long, "utf8"));
  const { items } = await ask(service.url, "GET", "/sessions");
  const other = items.find(({ name }) => name === "sick").id;
  const view = await page(chromium);
  await view.goto(`${service.url}/compare?a=${id}&b=${other}`);
  const cards = view.locator(".compared > section").filter({ has: view.getByRole("img") });
  await cards.filter({ hasText: "long" }).getByText("one of 2 judged moments is drawn").waitFor();
  assert.equal(await view.getByText(/^Thinned/).count(), 1);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("without two sessions the page leads to the list", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/compare`);
  await view.getByRole("link", { name: "list of sessions" }).click();
  await view.getByRole("heading", { name: "Sessions" }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
