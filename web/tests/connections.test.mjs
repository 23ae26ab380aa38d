// The connections of many tabs: a browser has six to a service over HTTP/1.1.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { recordings } from "./rigs.mjs";
import { ask, browser, directory, page, remove, serve, tab } from "./support.mjs";

let work, service, chromium, rig;

before(async () => {
  work = directory();
  rig = recordings(work);
  // As a user's browser does, it keeps pages that were left for its Back button.
  chromium = await browser({ ignoreDefaultArgs: ["--disable-back-forward-cache"] });
  service = await serve(`${work}/store`);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
});

after(async () => {
  await chromium?.close();
  await service?.stop();
  remove(work);
});

/** Tells a page that its tab went to the background, or came back: without a window, all tabs are visible. */
const setVisible = (view, isVisible) =>
  view.evaluate(
    (state) => {
      Object.defineProperty(document, "visibilityState", { configurable: true, get: () => state });
      document.dispatchEvent(new Event("visibilitychange"));
    },
    isVisible ? "visible" : "hidden",
  );

/** Waits until a page has loaded what it shows, and its stream of events is open. */
async function loaded(view) {
  await view.getByText("No session is open").waitFor();
  await view.getByRole("status").getByText("live", { exact: true }).waitFor();
}

test("eight tabs of a rig load, and so does a tab that is looked at again", async () => {
  const first = await page(chromium);
  const views = [first];
  await first.goto(`${service.url}/rigs/bench`);
  await loaded(first);
  while (views.length < 8) {
    await setVisible(views.at(-1), false);
    const next = await tab(first.context());
    await next.goto(`${service.url}/rigs/bench`);
    await loaded(next);
    views.push(next);
  }
  await setVisible(views.at(-1), false);
  const streams = [/\/api\/v1\/events/, /\/stream\?/].map((url) =>
    url.source.includes("events")
      ? first.waitForRequest(url)
      : first.waitForEvent("websocket", (socket) => url.test(socket.url())),
  );
  await setVisible(first, true);
  await Promise.all(streams);
  for (const view of views) assert.deepEqual(view.errors, []);
  await first.done();
});

test("nine pages are loaded one after the other, and the way back leads to a live page", async () => {
  const view = await page(chromium);
  for (let i = 0; i < 9; i++) {
    await view.goto(`${service.url}/rigs/bench?visit=${i}`);
    await loaded(view);
  }
  const opened = view.waitForRequest(/\/api\/v1\/events/);
  // A page that was kept has no further event `load`.
  await view.goBack({ waitUntil: "commit" });
  await opened;
  await loaded(view);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("what happened while a tab was hidden is told once when it is looked at again", async () => {
  const watched = await page(chromium, { viewport: { width: 1500, height: 900 } });
  await watched.goto(service.url);
  const hidden = await tab(watched.context());
  await hidden.goto(service.url);
  const feed = (view) => view.getByRole("region", { name: "Events" });
  const lines = (view) => feed(view).getByRole("listitem");
  for (const view of [watched, hidden]) await view.getByRole("link", { name: /bench/ }).waitFor();
  // An event that both have seen.
  const upload = (name) =>
    ask(service.url, "POST", `/assets/bench/telemetry?session=${name}`, rig.sick, "text/csv");
  await upload("first");
  for (const view of [watched, hidden]) await lines(view).first().waitFor();
  await setVisible(hidden, false);
  await hidden.waitForEvent("requestfailed", (request) => request.url().includes("/api/v1/events"));
  const before = await lines(watched).count();
  assert.equal(await lines(hidden).count(), before);
  const { items } = await ask(service.url, "GET", "/sessions?asset=bench&state=open");
  await ask(service.url, "POST", `/sessions/${items[0].id}/end`);
  await upload("second");
  await lines(watched).nth(before).waitFor();
  assert.equal(await lines(hidden).count(), before, "a hidden tab has no stream");
  await setVisible(hidden, true);
  await lines(hidden).nth(before).waitFor();
  const told = async (view) =>
    (await lines(view).allTextContents()).map((text) => text.replace(/^.*(?=bench:)/, ""));
  assert.deepEqual(await told(hidden), await told(watched));
  assert.deepEqual([...watched.errors, ...hidden.errors], []);
  await watched.done();
});
