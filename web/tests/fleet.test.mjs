// The fleet: empty, large, with a fault, and with a service that restarts.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { recordings } from "./rigs.mjs";
import { ask, browser, directory, page, remove, serve } from "./support.mjs";

let work, service, chromium, rig;

before(async () => {
  work = directory();
  chromium = await browser();
  rig = recordings(work);
});

after(async () => {
  await chromium?.close();
  remove(work);
});

test("an empty fleet offers the set-up", async () => {
  const empty = await serve(directory());
  const view = await page(chromium);
  await view.goto(empty.url);
  await view.getByText("No rig yet").waitFor();
  await view.getByRole("link", { name: "Set up a rig" }).click();
  await view.getByRole("heading", { name: "Set up a rig" }).waitFor();
  await view.goto(`${empty.url}/sessions`);
  await view.getByText("No session yet").waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
  await empty.stop();
});

const N = 3000;

test("thousands of rigs can be searched and filtered, and only visible rows are in the document", async () => {
  service = await serve(`${work}/many`);
  for (let i = 0; i < N; i += 100) {
    await Promise.all(
      Array.from({ length: 100 }, (_, k) => ask(service.url, "POST", "/assets", { name: `rig-${i + k}` })),
    );
  }
  await ask(service.url, "PUT", "/assets/rig-7", { ...rig.learnt, name: "rig-7" });
  const view = await page(chromium);
  await view.goto(service.url);
  await view.getByRole("button", { name: /^All/ }).getByText("3\u202f000").waitFor();
  const rows = view.getByRole("list", { name: "Rigs" }).getByRole("listitem");
  assert.ok((await rows.count()) < 60, `${await rows.count()} rows are in the document`);
  await view.evaluate(() => scrollTo(0, document.body.scrollHeight / 2));
  await view.getByRole("link", { name: /rig-1500/ }).waitFor();
  assert.ok((await rows.count()) < 60);
  // Back from a rig, the list is where it was.
  await view.getByRole("link", { name: /rig-1500/ }).click();
  await view.getByRole("heading", { name: "Monitors" }).waitFor();
  await view.goBack();
  await view.getByRole("link", { name: /rig-1500/ }).waitFor();
  await view.getByRole("searchbox").fill("rig-29 no-such");
  await view.getByText("No rig matches").waitFor();
  await view.getByRole("searchbox").fill("rig-2999");
  await view.getByRole("link", { name: /rig-2999/ }).waitFor();
  assert.equal(await rows.count(), 1);
  assert.match(view.url(), /search=rig-2999/);
  await view.getByRole("searchbox").fill("");

  // A fault is shown at the top, and can be filtered.
  await ask(service.url, "POST", "/assets/rig-7/telemetry?session=now", rig.sick, "text/csv");
  await view
    .getByRole("region", { name: "Rigs" })
    .getByText(/X servo/)
    .waitFor();
  await view.getByRole("button", { name: /^Fault/ }).click();
  // Once the fault is confirmed; until then it is suspected.
  await rows.filter({ hasText: "rig-7" }).first().waitFor();
  assert.equal(await rows.filter({ hasText: "rig-7" }).count(), 1);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("after a restart of the service, the page catches up", async () => {
  const view = await page(chromium, { viewport: { width: 1500, height: 900 } });
  await view.goto(`${service.url}/?search=rig-8`);
  await view
    .getByRole("link", { name: /rig-8\b/ })
    .first()
    .waitFor();
  await view.getByText("live", { exact: true }).waitFor();
  const { port } = service;
  const rigView = await page(chromium);
  await rigView.goto(`${service.url}/rigs/rig-9`);
  await rigView.getByRole("heading", { name: "Monitors" }).waitFor();
  await service.stop();
  await view.getByText("connection lost").waitFor();
  // Without a connection, nothing is known of the rig; a page that was not loaded yet waits for the service.
  await rigView.getByText("not known").first().waitFor();
  await rigView.getByRole("link", { name: "Alarms" }).click();
  await rigView.getByText("This page is loaded as soon as it does").waitFor();
  await view.getByText("The service does not answer").waitFor();
  service = await serve(`${work}/many`, port);
  await ask(service.url, "PUT", "/assets/rig-8", { ...rig.learnt, name: "rig-8" });
  await ask(service.url, "POST", "/assets/rig-8/telemetry?session=later", rig.sick, "text/csv");
  await view.getByText("live", { exact: true }).waitFor();
  await view
    .getByRole("region", { name: "Rigs" })
    .getByText(/X servo/)
    .first()
    .waitFor();
  await view.getByText("The service does not answer").waitFor({ state: "detached" });
  await rigView.getByRole("heading", { name: "Alarms" }).waitFor();
  await rigView.done();
  // The missed events arrive, each once.
  const feed = view.getByRole("region", { name: "Events" });
  await feed.getByText(/X servo.* confirmed/).waitFor();
  assert.equal(await feed.getByRole("listitem").count(), 2);
  assert.deepEqual(view.errors, []);
  await view.done();
  await service.stop();
});
