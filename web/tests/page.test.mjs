// The served page: size, caching, no third-party requests, accessibility.
import assert from "node:assert/strict";
import { test } from "node:test";
import { get } from "node:http";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { brotliDecompressSync } from "node:zlib";
import { calibrated, imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

/** First load without the 3D view, bytes as sent. */
const FIRST_LOAD = 500_000;

let work, service, chromium, session;

started(async (made) => {
  ({ work, service, chromium } = made);
  const { learnt, sick, healthy } = recordings(work);
  await ask(service.url, "POST", "/assets", { ...learnt, name: "bench" });
  session = await imported(service.url, "bench", "monday", sick);
  await ask(service.url, "POST", "/assets", { name: "taught" });
  const { id } = await imported(service.url, "taught", "healthy", healthy);
  await calibrated(service.url, "taught", id);
});

const fetched = (path, headers = {}) =>
  new Promise((done, failed) => {
    get(service.url + path, { headers }, (answer) => {
      const parts = [];
      answer.on("data", (part) => parts.push(part));
      answer.on("end", () =>
        done({ status: answer.statusCode, headers: answer.headers, body: Buffer.concat(parts) }),
      );
    }).on("error", failed);
  });

test("the page is revalidated by its ETag, its parts are immutable", async () => {
  const html = await fetched("/", { accept: "text/html" });
  assert.equal(html.status, 200);
  assert.match(html.headers["content-security-policy"], /default-src 'self'/);
  assert.equal(html.headers["cache-control"], "no-cache");
  assert.equal((await fetched("/", { "if-none-match": html.headers.etag })).status, 304);
  assert.equal((await fetched("/", { "if-none-match": '"other"' })).status, 200);
  const script = /src="(\/static\/[^"]+\.js)"/.exec(html.body)[1];
  const plain = await fetched(script);
  assert.match(plain.headers["cache-control"], /immutable/);
  assert.match(plain.headers["content-type"], /javascript/);
  const packed = await fetched(script, { "accept-encoding": "gzip, br" });
  assert.equal(packed.headers["content-encoding"], "br");
  assert.ok(packed.body.length < plain.body.length / 2);
  assert.deepEqual(brotliDecompressSync(packed.body), plain.body);
  assert.notEqual(packed.headers.etag, plain.headers.etag);
});

test("addresses of views return the page, others a problem", async () => {
  const html = { accept: "text/html,*/*" };
  assert.match((await fetched("/rigs/bench", html)).headers["content-type"], /text\/html/);
  for (const [path, headers] of [
    ["/none", {}],
    ["/api/v1/none", html],
    ["/static/none.js", html],
  ]) {
    const answer = await fetched(path, headers);
    assert.equal(answer.status, 404, path);
    assert.match(answer.headers["content-type"], /problem\+json/, path);
  }
});

test("the first load is small and requests nothing from other hosts", async () => {
  const view = await page(chromium);
  let bytes = 0;
  const foreign = [];
  const client = await view.context().newCDPSession(view);
  await client.send("Network.enable");
  client.on("Network.loadingFinished", ({ encodedDataLength }) => (bytes += encodedDataLength));
  view.on("request", (request) => request.url().startsWith(service.url) || foreign.push(request.url()));
  await view.goto(`${service.url}/rigs/bench/faults/x_servo`);
  await view.getByRole("heading", { name: "Before and after" }).waitFor();
  await view.goto(service.url);
  await view.getByText("bench").first().waitFor();
  assert.ok(bytes > 10_000 && bytes < FIRST_LOAD, `${bytes} bytes`);
  assert.deepEqual(foreign, []);
  assert.deepEqual(view.errors, []);
  await view.done();
});

/** The views, each with a text that it shows. */
const VIEWS = () => [
  ["/", "bench"],
  ["/?layout=wall", "bench"],
  ["/rigs/bench", "Monitors"],
  ["/rigs/bench/faults/x_servo", "Freeze frame"],
  ["/rigs/bench/faults/sensor", "Nothing is on record"],
  ["/rigs/taught/calibrations", "Along x the residual is"],
  ["/sessions", "monday"],
  [`/sessions/${session.id}`, "Judge again"],
  [`/compare?a=${session.id}&b=${session.id}`, "Compare sessions"],
  [`/sessions/${session.id}/report`, "Calibration and certificate"],
  ["/rigs/bench/faults/x_servo/report", "Calibration and certificate"],
  ["/alarms", "What to do"],
  ["/notifications", "no notifications are sent"],
  ["/administration", "Audit log"],
  ["/set-up", "Units that the device sends"],
  ["/rigs/bench/set-up?step=connect", "Waiting for the first sample"],
  ["/rigs/bench/set-up?step=check", "Signs and units"],
  ["/rigs/bench/set-up?step=learn", "Detection times"],
  ["/learn", "Why 0.01"],
  ["/nowhere", "Page not found"],
];

for (const colorScheme of ["light", "dark"]) {
  for (const width of [390, 1280]) {
    test(`every view is accessible, ${colorScheme}, ${width} px wide`, async () => {
      const view = await page(chromium, { colorScheme, viewport: { width, height: 800 } });
      for (const [path, sign] of VIEWS()) {
        await view.goto(service.url + path);
        await view.getByText(sign).first().waitFor();
        await view.evaluate(AXE);
        const { violations } = await view.evaluate(() => window.axe.run());
        const serious = violations.filter(({ impact }) => ["serious", "critical"].includes(impact));
        const words = serious.map(
          ({ id, nodes }) =>
            `${id}: ${nodes
              .map((node) => node.html)
              .join(" | ")
              .slice(0, 400)}`,
        );
        assert.deepEqual(words, [], path);
        const over = await view.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(over <= 0, `${path} is ${over} px too wide`);
      }
      assert.deepEqual(view.errors, []);
      await view.done();
    });
  }
}

for (const width of [320, 720, 768])
  test(`every view is as wide as the screen, ${width} px`, async () => {
    const view = await page(chromium, { viewport: { width, height: 800 } });
    for (const [path, sign] of VIEWS()) {
      await view.goto(service.url + path);
      await view.getByText(sign).first().waitFor();
      const over = await view.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(over <= 0, `${path} is ${over} px too wide`);
    }
    await view.done();
  });

test("the description of the API opens beside the page", async () => {
  const view = await page(chromium);
  await view.goto(service.url);
  const opened = view.context().waitForEvent("page");
  await view.getByRole("link", { name: "API", exact: true }).click();
  await (await opened).waitForURL(/\/docs\/$/);
  await view.getByText("bench").first().waitFor();
  await view.done();
});

test("an unknown rig, fault or session gives a message", async () => {
  const view = await page(chromium);
  for (const [path, words] of [
    ["/rigs/nobody", "There is no such rig"],
    ["/rigs/bench/faults/none", "There is no such fault"],
    ["/sessions/none", "There is no such session"],
  ]) {
    await view.goto(service.url + path);
    await view.getByRole("alert").getByText(words).waitFor();
  }
  await view.goto(`${service.url}/sessions?asset=nobody`);
  await view.getByText("There is no rig called nobody").waitFor();
  await view.goto(`${service.url}/rigs/bench/set-up?step=zzz`);
  await view.getByText("Units that the device sends").waitFor();
  assert.ok(
    view.errors.every((error) => error.includes("404")),
    view.errors.join("\n"),
  );
  await view.done();
});

test("the page works by keyboard, and the theme is stored", async () => {
  const view = await page(chromium);
  await view.goto(service.url);
  await view.getByRole("link", { name: /bench/ }).first().waitFor();
  await view.keyboard.press("Tab");
  assert.equal(await view.evaluate(() => document.activeElement.textContent), "Skip to the content");
  await view.getByRole("link", { name: /bench/ }).first().press("Enter");
  await view.getByRole("heading", { name: "Monitors" }).waitFor();
  const change = view.getByRole("button", { name: /Colours/ });
  await change.click();
  await change.click();
  assert.equal(await view.evaluate(() => document.documentElement.dataset.theme), "dark");
  await view.reload();
  await view.getByRole("heading", { name: "Monitors" }).waitFor();
  assert.equal(await view.evaluate(() => document.documentElement.dataset.theme), "dark");
  await view.done();
});
