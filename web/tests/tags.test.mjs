// Tags of rigs in the page, and the layout for a wall screen.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let work, service, chromium;

started(async (made) => {
  ({ work, service, chromium } = made);
  const { learnt, sick } = recordings(work);
  for (const name of ["bench", "shelf"]) await ask(service.url, "POST", "/assets", { ...learnt, name });
  await imported(service.url, "bench", "monday", sick);
  await ask(service.url, "PUT", "/assets/shelf/tags", { tags: ["hall-1"] });
});

test("tags are set on the rig's page and select rigs, alarms and sessions", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/bench`);
  await view.getByRole("button", { name: "Add tags" }).click();
  await view.getByRole("textbox", { name: "Tags, separated by blanks" }).fill("hall-2 spare");
  await view.getByRole("textbox", { name: "Tags, separated by blanks" }).press("Enter");
  await view.getByRole("link", { name: "hall-2" }).click();
  const rigs = view.getByRole("list", { name: "Rigs" });
  await rigs.getByRole("link", { name: /bench/ }).waitFor();
  assert.equal(await rigs.getByRole("listitem").count(), 1);
  await view.getByLabel(/^Tag/).selectOption("hall-1");
  await rigs.getByRole("link", { name: /shelf/ }).waitFor();
  assert.match(view.url(), /tag=hall-1/);
  assert.deepEqual((await ask(service.url, "GET", "/assets/bench/tags")).tags, ["hall-2", "spare"]);

  await view.goto(`${service.url}/alarms`);
  await view
    .getByRole("link", { name: /X servo/ })
    .first()
    .waitFor();
  await view.getByLabel(/^Tag/).selectOption("hall-1");
  await view.getByText("No alarm matches this filter").waitFor();

  await view.goto(`${service.url}/sessions?tag=hall-2`);
  await view.getByRole("link", { name: "monday" }).waitFor();
  await view.getByLabel(/^Tag/).selectOption("hall-1");
  await view.getByText("No session matches").waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a view is saved, opened, renamed and deleted, and is there after a reload", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/alarms?tag=hall-1&state=all`);
  assert.equal(await view.getByLabel("State").inputValue(), "all");
  await view.getByRole("button", { name: "Views" }).click();
  await view.getByLabel("Name of the present view").fill("first hall");
  await view.getByRole("button", { name: "Save" }).click();
  await view.getByRole("button", { name: "first hall", exact: true }).waitFor();
  await view.goto(`${service.url}/alarms`);
  await view.getByRole("button", { name: "Views" }).click();
  await view.getByRole("button", { name: "Rename first hall" }).click();
  await view.getByLabel("New name of first hall").fill("hall one");
  await view.getByRole("button", { name: "Rename" }).click();
  await view.getByRole("button", { name: "hall one", exact: true }).click();
  await view.getByText("No alarm matches this filter").waitFor();
  assert.match(view.url(), /alarms\?.*tag=hall-1/);
  await view.getByRole("button", { name: "Views" }).click();
  await view.getByRole("button", { name: "Delete hall one" }).click();
  await view.getByText("None yet").waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a wall screen shows a tile for each rig, the worst group first", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/?layout=wall`);
  const bench = view.getByRole("region", { name: "hall-2" }).getByRole("link", { name: /bench/ });
  await bench
    .getByText("on record")
    .or(bench.getByText("fault", { exact: true }))
    .first()
    .waitFor();
  assert.deepEqual(await view.locator(".wall-group h2").allTextContents(), ["hall-2", "spare", "hall-1"]);
  await view.getByRole("button", { name: "List view" }).click();
  await view.getByRole("list", { name: "Rigs" }).waitFor();
  assert.doesNotMatch(view.url(), /layout/);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("tags that somebody else has changed meanwhile are not overwritten", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/shelf`);
  await view.getByRole("button", { name: "Change tags" }).click();
  await ask(service.url, "PUT", "/assets/shelf/tags", { tags: ["hall-3"] });
  await view.getByRole("textbox", { name: "Tags, separated by blanks" }).fill("hall-1 mine");
  await view.getByRole("button", { name: "Save" }).click();
  await view.getByText("Somebody has changed this since the page showed it").waitFor();
  assert.deepEqual((await ask(service.url, "GET", "/assets/shelf/tags")).tags, ["hall-3"]);
  await view.reload();
  await view.getByRole("button", { name: "Change tags" }).click();
  await view.getByRole("textbox", { name: "Tags, separated by blanks" }).fill("hall-1 mine");
  await view.getByRole("button", { name: "Save" }).click();
  await view.getByRole("link", { name: "mine" }).waitFor();
  await view.done();
});
