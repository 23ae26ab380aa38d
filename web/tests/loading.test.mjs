// How the parts of a page are loaded.
import assert from "node:assert/strict";
import { test } from "node:test";
import { ask, page, started } from "./support.mjs";

let service, chromium;

started(async (made) => {
  ({ service, chromium } = made);
  await ask(service.url, "PUT", "/assets/bench", { name: "bench" });
});

test("the code of a view is loaded before the service has answered who the caller is", async () => {
  const view = await page(chromium);
  let found;
  const code = new Promise((resolve) => (found = resolve));
  const html = await (await fetch(service.url)).text();
  const isLazy = (url) => url.endsWith(".js") && !html.includes(new URL(url).pathname);
  view.on("request", (request) => isLazy(request.url()) && found());
  await view.route("**/api/v1/login", async (route) => {
    await code;
    await route.continue();
  });
  await view.goto(`${service.url}/rigs/bench`);
  await view.getByRole("heading", { name: "Monitors" }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
