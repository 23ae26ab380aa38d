// The addresses that the service answers with a page, and who did what.
import assert from "node:assert/strict";
import { test } from "node:test";
import { ask, page, started } from "./support.mjs";

let service, chromium;

started(async (made) => {
  ({ service, chromium } = made);
  await ask(service.url, "POST", "/assets", { name: "bench" });
});

test("routes of the page are answered to everybody, and the page of the API leads back to it", async () => {
  for (const path of ["/rigs/bench", "/jobs"]) {
    const answer = await fetch(service.url + path, { headers: { accept: "*/*" } });
    assert.deepEqual([answer.status, answer.headers.get("content-type")], [200, "text/html"], path);
  }
  assert.equal((await fetch(`${service.url}/no-such-route`, { headers: { accept: "*/*" } })).status, 404);
  const view = await page(chromium);
  await view.goto(`${service.url}/docs/`);
  assert.equal(await view.title(), "API · offbd");
  await view.getByRole("link", { name: "Dashboard" }).click();
  await view.getByRole("heading", { name: "Fleet" }).waitFor();
  await view.done();
});

test("the audit log has the name that an action was done with, also without tokens", async () => {
  await ask(service.url, "PUT", "/advice/sensor/note?by=ada", { text: "Clean it." });
  const [{ actor, act }] = (await ask(service.url, "GET", "/audit")).items;
  assert.deepEqual([actor, act], ["ada", "put_note"]);
});
