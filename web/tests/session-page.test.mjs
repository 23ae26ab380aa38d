// The page of a session: its address, the charts under the pointer, and what a verdict rests on.
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
});

test("a link leads to the moment, speed and profile, and charts are zoomed and read by the pointer", async () => {
  const session = await imported(service.url, "bench", "linked", rig.sick);
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}?t=99999&speed=2&profile=default`);
  await view.getByText(/^(39|40)\.\d\d s$/).waitFor();
  assert.equal(await view.getByLabel("Speed").inputValue(), "2");
  assert.equal(await view.getByLabel("Judged by").inputValue(), "default");
  await view.getByRole("slider", { name: "Moment" }).fill("12");
  await view.waitForURL(/t=12\.00/);

  // The evidence of the chosen monitor is drawn with the values at which it decides.
  await view.getByRole("img", { name: /Evidence against the x servo/ }).waitFor();
  await view.getByLabel("Monitor").selectOption({ label: "Position sensor" });
  await view.getByRole("img", { name: /Fault detection counter, position sensor/ }).waitFor();
  assert.equal(await view.getByRole("img", { name: /Evidence against/ }).count(), 0);

  await view.getByText("Histogram of the residual").click();
  await view.getByRole("img", { name: /Histogram of the residual along x: \d+ of \d+ judged/ }).waitFor();

  const chart = view.getByRole("img", { name: /^Residual along x/ });
  await chart.scrollIntoViewIfNeeded();
  const box = await chart.boundingBox();
  const at = (share) => [box.x + box.width * share, box.y + box.height / 2];
  await view.mouse.move(...at(0.4));
  await view.locator(".cursor-time").first().getByText(/at \d/).waitFor();
  await view
    .locator(".cursor-value")
    .first()
    .getByText(/\d\.\d{3}/)
    .waitFor();
  await view.mouse.down();
  await view.mouse.move(...at(0.6), { steps: 4 });
  await view.mouse.up();
  const zoom = view.getByRole("group", { name: "Zoom" });
  const shown = async () => (await zoom.textContent()).match(/[\d.]+/g).map(Number);
  const [from, to] = await shown();
  assert.ok(to - from > 2 && to - from < 10, `${from} to ${to}`);
  await zoom.getByRole("button", { name: "Later" }).click();
  await view.waitForFunction(
    (was) => !document.querySelector("[aria-label=Zoom]").textContent.includes(was),
    `${from}`,
  );
  assert.ok((await shown())[0] > from);
  await view.mouse.dblclick(...at(0.5));
  await zoom.waitFor({ state: "detached" });
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("of a long session, the shown part is fetched with every judged moment", async () => {
  offbd("simulate", "--seconds", "900", "--reference", "lissajous", "-o", rig.path("long.csv"));
  const session = await imported(service.url, "bench", "long", readFileSync(rig.path("long.csv"), "utf8"));
  const view = await page(chromium);
  const part = view.waitForResponse((response) => /\/trace\?.*from_s=1\d\d/.test(response.url()));
  await view.goto(`${service.url}/sessions/${session.id}?t=200`);
  assert.equal((await (await part).json()).stride, 1);
  await view.getByText("Every judged moment is drawn").waitFor();
  await view.getByText("Histogram of the residual").click();
  await view.getByRole("img", { name: /Histogram of the residual along x: .* judged moments/ }).waitFor();
  await view.getByRole("combobox", { name: "Show" }).selectOption({ label: "all" });
  await view.getByText(/Thinned: one of \d+ judged moments is drawn/).waitFor();
  await view.getByText(/Thinned: one of \d+ judged moments is counted/).waitFor();
  await view.getByRole("img", { name: /Histogram of the residual along x: .* counted moments/ }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a session without a calibration says what its verdict rests on", async () => {
  await ask(service.url, "POST", "/assets", { name: "unlearnt" });
  const session = await imported(service.url, "unlearnt", "first", rig.healthy);
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}`);
  await view.getByText("Judged without a calibration, with the default dimensions").waitFor();
  assert.equal(await view.getByText("No fault", { exact: true }).count(), 0);
  await view.goto(`${service.url}/rigs/unlearnt`);
  await view.getByText("The last one,").waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a session of which nothing could be judged shows its samples, its verdict and its warnings", async () => {
  const [head, ...lines] = rig.healthy.trim().split("\n");
  const rows = lines.map((line) => line.replace(/^[\d.]+/, (t) => String(Math.round(Number(t) * 1000))));
  const session = await imported(service.url, "bench", "in-milliseconds", [head, ...rows].join("\n"));
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}`);
  await view.getByText(/^\d+\u202f\d{3} samples are recorded, but no moment could be judged/).waitFor();
  await view.locator(".verdict").getByText("Not judged", { exact: true }).waitFor();
  const warnings = view.getByRole("region", { name: "Warnings" });
  await warnings.getByText(/^A sample comes every 10\S* s, .*: is t_s in ms\?/).waitFor();
  await view.getByRole("link", { name: "Report" }).click();
  await warnings.getByText(/^A sample comes every 10\S* s, .*: is t_s in ms\?/).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("sliders show the alarms that other limits and debounce times would raise", async () => {
  const session = await imported(service.url, "bench", "tried", rig.sick);
  const view = await page(chromium);
  let asked = 0;
  view.on("request", (request) => void (asked += /\/trial/.test(request.url()) ? 1 : 0));
  await view.goto(`${service.url}/sessions/${session.id}`);
  await view.getByRole("heading", { name: "Judge again" }).waitFor();
  await view.getByText("Loading 3D").waitFor({ state: "detached" });
  // A trial judges the whole session: only who comes to its card asks for one.
  assert.equal(asked, 0);
  const row = view.locator(".trial tbody tr").first();
  await row.scrollIntoViewIfNeeded();
  await row.getByText("1 alarm", { exact: true }).waitFor();
  await view.getByRole("slider", { name: "Debounce of X servo" }).fill("0");
  await row
    .getByText(/[1-9]\d* alarm/)
    .first()
    .waitFor();
  await view.getByRole("slider", { name: "Limit of X servo" }).fill("3");
  await row.getByText("0 alarms (as set: 1)").waitFor();
  await view.setViewportSize({ width: 390, height: 800 });
  const table = view.getByRole("region", { name: "Limits and debounce times" });
  const cut = await table.evaluate((box) => box.scrollWidth - box.clientWidth);
  assert.ok(cut <= 0, `${cut} px of the alarms are off the screen of a phone`);
  await view.getByRole("button", { name: "Reset" }).click();
  await row.getByText("1 alarm", { exact: true }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a remark on a moment is kept, listed and removed", async () => {
  const session = await imported(service.url, "bench", "remarked", rig.sick);
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}?t=12`);
  await view.getByText("12.00 s", { exact: true }).waitFor();
  await view.getByLabel("Remark", { exact: true }).fill("new horn");
  await view.getByLabel("Your name, recorded with the action").fill("ada");
  await view.getByRole("button", { name: "Add remark at this moment" }).click();
  const list = view.getByRole("list", { name: "Remarks" });
  await list.getByText("new horn").waitFor();
  await list.getByText(/^ada, /).waitFor();
  await list
    .getByRole("button", { name: /^12\.00/ })
    .first()
    .waitFor();
  await view.reload();
  await list.getByText("new horn").waitFor();
  await list.getByRole("button", { name: /^Remove the remark/ }).click();
  await list.waitFor({ state: "detached" });
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("an open session has no recorded verdict, whatever it was judged to be since", async () => {
  await ask(service.url, "PUT", "/assets/open", { ...rig.learnt, name: "open" });
  await ask(service.url, "POST", "/assets/open/telemetry?session=now", rig.sick, "text/csv");
  const { items } = await ask(service.url, "GET", "/sessions?asset=open");
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${items[0].id}`);
  await view.getByRole("button", { name: "Judge again" }).click();
  const recorded = view.locator("dt:text-is('Recorded') + dd");
  await recorded.getByText("when the session has ended").waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("a recording with one axis says that the ball cannot be drawn; touching the 3D view scrolls", async () => {
  const [head, ...lines] = rig.healthy.trim().split("\n");
  const y = head.split(",").indexOf("y_m");
  const oneAxis = lines.map((line) => line.split(",").map((cell, i) => (i === y ? "" : cell)));
  const text = [head, ...oneAxis.map((cells) => cells.join(","))].join("\n");
  const session = await imported(service.url, "bench", "one-axis", text);
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions/${session.id}`);
  await view.getByText("The recording has no position along y").waitFor();
  const canvas = view.locator(".stage canvas").first();
  await canvas.waitFor();
  assert.equal(await canvas.evaluate((element) => getComputedStyle(element).touchAction), "pan-y");
  // The play button leaves the arrow keys to the playback.
  const clock = view.locator("output.clock");
  const before = await clock.textContent();
  await view.getByRole("button", { name: "Play", exact: true }).focus();
  await view.keyboard.press("ArrowRight");
  await view.waitForFunction((was) => document.querySelector("output.clock").textContent !== was, before);
  assert.deepEqual(view.errors, []);
  await view.done();
});
