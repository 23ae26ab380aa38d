// A rig whose data stay away: in the feed of the fleet, in its row, and on its page.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
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
  await feed.getByText("No data arrive although a session is open").waitFor();
  await feed.getByRole("link", { name: /bench: Communication lost/ }).waitFor();
  const row = fleet.getByRole("list", { name: "Rigs" });
  await row.getByText(/Communication lost since \d/).waitFor();

  const alarm = rig.getByRole("alert").filter({ hasText: "Communication lost" });
  await alarm.getByText(/Communication lost since \d/).waitFor();
  await alarm.getByLabel("Your name, recorded with the action").fill("ada");
  await alarm.getByRole("button", { name: "Acknowledge" }).click();
  await alarm.getByText(/Acknowledged by ada, /).waitFor();
  assert.equal(await alarm.getByRole("button").count(), 0);

  // Data arrive again, until they count as back.
  await until(async () => {
    await send();
    return (await feed.getByText("Data arrive again.").count()) > 0;
  });
  await alarm.waitFor({ state: "detached" });
  await row.getByText("Communication lost").waitFor({ state: "detached" });
  assert.equal(await feed.getByRole("listitem").count(), 2, "each change once");
  assert.deepEqual([...fleet.errors, ...rig.errors], []);
  await rig.done();
  await fleet.done();
});
