// How data of a rig arrive, and that they stay away: in the feed of the fleet, in its row, and on its page.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { recordings } from "./rigs.mjs";
import { ask, browser, directory, page, remove, serve, until } from "./support.mjs";

let work, service, chromium;

before(async () => {
  work = directory();
  chromium = await browser();
  const config = join(work, "offbd.toml");
  writeFileSync(config, "[communication]\nlost_after_s = 2\nback_after_s = 1\n");
  service = await serve(join(work, "data"), 0, "--config", config);
  await ask(service.url, "POST", "/assets", { name: "bench" });
});

after(async () => {
  await chromium?.close();
  await service?.stop();
  remove(work);
});

test("lost communication is told since when and by whom it is acknowledged, and when data are back", async () => {
  const fleet = await page(chromium, { viewport: { width: 1500, height: 900 } });
  await fleet.goto(service.url);
  await fleet.getByRole("link", { name: /bench/ }).waitFor();
  const rig = await page(chromium);
  await rig.goto(`${service.url}/rigs/bench`);
  await rig.getByRole("heading", { name: "Monitors" }).waitFor();
  let t_s = 0;
  const send = () =>
    ask(service.url, "POST", "/assets/bench/telemetry", { samples: [{ t_s: t_s++, x_m: 0, y_m: 0 }] });
  await send();

  const feed = fleet.getByRole("region", { name: "Events" });
  await feed.getByText(/^No data since .*, though a session is open\.$/).waitFor();
  await feed.getByRole("link", { name: /bench: Data stopped/ }).waitFor();
  const row = fleet.getByRole("list", { name: "Rigs" });
  await row.getByText(/No data since \d/).waitFor();

  // A page that is opened now has no reason to call the rig silent.
  const late = await page(chromium);
  await late.goto(`${service.url}/rigs/bench`);
  await late.getByText(/No data since \d/).waitFor();
  // Not known until the rig's faults are there.
  await late.locator("h1 .health", { hasText: /^○no data$/ }).waitFor();
  await late.done();

  const alarm = rig.getByRole("alert").filter({ hasText: "No data since" });
  await alarm.getByText(/No data since \d/).waitFor();
  await alarm.getByLabel("Your name, recorded with the action").fill("ada");
  await alarm.getByRole("button", { name: "Acknowledge" }).click();
  await alarm.getByText(/Acknowledged by ada, /).waitFor();
  assert.equal(await alarm.getByRole("button", { name: "Acknowledge" }).count(), 0);

  // Data arrive again, until they count as back.
  await until(async () => {
    await send();
    return (await feed.getByText("Data arrive again.").count()) > 0;
  });
  await alarm.waitFor({ state: "detached" });
  await row.getByText(/No data since/).waitFor({ state: "detached" });
  assert.equal(await feed.getByRole("listitem").count(), 2, "each change once");
  assert.deepEqual([...fleet.errors, ...rig.errors], []);
  await rig.done();
  await fleet.done();
});

/** The text of a cell of the card of the link. */
const cell = (card, row, column) =>
  card
    .getByRole("row", { name: new RegExp(`^${row} `) })
    .getByRole("cell")
    .nth(column);

test("the card of the link tells how the samples of a rig arrive", async () => {
  await ask(service.url, "POST", "/assets", { name: "linked", sample_rate_hz: 100 });
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/linked`);
  const card = view.getByRole("region", { name: "Link" });
  await card.getByText("No samples have arrived since the service was started.").waitFor();
  // 10 ms apart, with a gap of 1.5 s, and with two rows that are none.
  const times = [...Array(50).keys()].map((i) => (i < 25 ? i * 0.01 : i * 0.01 + 1.49));
  const samples = [...times.map((t_s) => ({ t_s, x_m: 0, y_m: 0 })), { t_s: "?" }, {}];
  const { rejected } = await ask(service.url, "POST", "/assets/linked/telemetry", { session: "s", samples });
  assert.equal(rejected.length, 2);
  await card.getByText("100.0 per second").first().waitFor();
  for (const column of [0, 1]) {
    assert.equal(await cell(card, "Samples", column).textContent(), "50");
    assert.equal(await cell(card, "Rate", column).textContent(), "100.0 per second, 100 expected");
    assert.equal(await cell(card, "Spacing", column).textContent(), "10.0\u202fms ± 0.0\u202fms");
    assert.equal(await cell(card, "Gaps", column).textContent(), "1, of 1.5\u202fs");
    assert.equal(await cell(card, "Not judged", column).textContent(), "2 not readable");
    assert.equal(await cell(card, "Sent twice", column).textContent(), "none");
  }
  await card.getByText("which does not tell the time of day").waitFor();
  assert.equal(await card.getByText("not understood").count(), 0);
  const foreign = { session: "s", samples: [{ t_s: 1.99, x_m: 0, y_m: 0, cmd_qx: 0 }] };
  await ask(service.url, "POST", "/assets/linked/telemetry", foreign);
  await card.getByText("Keys of the telemetry that are not understood: cmd_qx (cmd_qx_rad?).").waitFor();
  await card.getByText(/^as of \d/).waitFor();
  await card.getByText(/^This session, counted since \d/).waitFor();
  // A page that is opened after the samples has nothing to draw, and says so instead of empty charts.
  await view.reload();
  await view.getByText(/The last sample was at \d\.\d\d\u202fs on the device's clock/).waitFor();
  assert.equal(await view.getByRole("img", { name: /over time/ }).count(), 0);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("lost communication is muted with a reason and for a time, before it is lost and after", async () => {
  await ask(service.url, "POST", "/assets", { name: "moved" });
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/moved`);
  const card = view.getByRole("region", { name: "Link" });
  await card.getByText("Alarms if data stop during a session").waitFor();
  await card.getByRole("button", { name: "Mute No data" }).click();
  const dialog = view.getByRole("dialog", { name: "Mute No data of moved" });
  await dialog.getByText(/No notification is sent if data stop/).waitFor();
  assert.ok(await dialog.getByRole("button", { name: "Mute" }).isDisabled(), "without a reason");
  await dialog.getByLabel("Why").fill("the rig moves to hall 2");
  await dialog.getByLabel("For").selectOption({ label: "a day" });
  await dialog.getByLabel("Your name, recorded with the action").fill("ada");
  await dialog.getByRole("button", { name: "Mute" }).click();
  await card.getByText(/muted by ada until .*: the rig moves to hall 2/).waitFor();
  const { items } = await ask(service.url, "GET", "/assets/moved/mutes");
  assert.deepEqual([items.length, items[0].code, items[0].by], [1, "communication_lost", "ada"]);
  const hours = (Date.parse(items[0].until) - Date.parse(items[0].at)) / 3_600_000;
  assert.equal(Math.round(hours), 24);

  await ask(service.url, "POST", "/assets/moved/telemetry", { samples: [{ t_s: 0, x_m: 0, y_m: 0 }] });
  const alarm = view.getByRole("alert").filter({ hasText: "No data since" });
  await alarm.getByText(/Muted by ada until .*: the rig moves to hall 2/).waitFor();
  const fleet = await page(chromium, { viewport: { width: 1500, height: 900 } });
  await fleet.goto(service.url);
  const row = fleet.getByRole("link", { name: /moved/ });
  await row.getByText("“No data” muted").waitFor();
  assert.match(await row.getByText(/No data since/).getAttribute("class"), /chip-muted/);

  await alarm.getByRole("button", { name: /^End the mute of No data/ }).click();
  await alarm.getByRole("button", { name: "Mute No data" }).waitFor();
  await card.getByText("Alarms if data stop during a session").waitFor();
  await row.getByText("“No data” muted").waitFor({ state: "detached" });
  assert.deepEqual([...view.errors, ...fleet.errors], []);
  await fleet.done();
  await view.done();
});

test("a rig that falls silent while it fails is told as both, everywhere", async () => {
  const { learnt, sick } = recordings(work);
  await ask(service.url, "POST", "/assets", { ...learnt, name: "cut" });
  await ask(service.url, "POST", "/assets/cut/telemetry", sick, "text/csv");
  const view = await page(chromium, { viewport: { width: 1440, height: 900 } });
  await view.goto(service.url);
  const row = view.getByRole("link", { name: /^cut/ });
  const isCut = (chip) => chip.evaluate((box) => box.scrollWidth > box.clientWidth);
  const silence = row.getByText(/No data since \d/);
  await silence.waitFor();
  assert.equal(await isCut(silence), false, "the time is at its end");
  await row.getByTitle(/^X servo.*: failed \d.*, when last tested; now silent$/).waitFor();
  await view.goto(`${service.url}/alarms`);
  const alarm = view.getByRole("row", { name: /cut X servo/ });
  await alarm.getByText(/^▲ failed when last tested; silent since \d/).waitFor();
  await view.goto(`${service.url}/rigs/cut`);
  const banner = view.getByRole("list", { name: "Active faults" });
  await banner.getByText(/^failed \d.*, when last tested; now silent$/).waitFor();
  for (const path of ["/rigs/cut/faults/x_servo", "/rigs/cut/faults/x_servo/report"]) {
    await view.goto(service.url + path);
    await view
      .getByText(/^It failed when it was last tested, \d.* The rig has been silent since \d/)
      .waitFor();
  }
  await view.goto(`${service.url}/rigs/cut/faults/x_servo`);
  await view.getByRole("heading", { name: /failed when last tested; now silent$/ }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});
