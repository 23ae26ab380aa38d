// The list of sessions: its filter is in the address, so that a view can be shared.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started } from "./support.mjs";

let service, chromium, rig;

started(async (made) => {
  ({ service, chromium } = made);
  rig = recordings(made.work);
  await ask(service.url, "POST", "/assets", { ...rig.learnt, name: "bench" });
  await imported(service.url, "bench", "run-1", rig.healthy);
  await imported(service.url, "bench", "run-2", rig.sick);
  await imported(service.url, "bench", "trial", rig.healthy);
});

/** Waits until the list has these sessions, in this order. */
const shows = (view, ...names) =>
  view.waitForFunction((wanted) => {
    const rows = [...document.querySelectorAll("tbody th[scope=row]")];
    return rows.map((row) => row.textContent).join() === wanted;
  }, names.join());

test("sessions are selected by name, verdict and day, ordered, and the address holds it", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await shows(view, "trial", "run-2", "run-1");

  await view.getByLabel("Session", { exact: true }).fill("run");
  await view.getByLabel("Session", { exact: true }).press("Enter");
  await shows(view, "run-2", "run-1");
  await view.getByLabel("Order").selectOption("Oldest first");
  await shows(view, "run-1", "run-2");
  await view.getByLabel("Verdict").selectOption({ label: "Fault" });
  await shows(view, "run-2");

  const today = await view.evaluate(() => new Date().toLocaleDateString("sv"));
  await view.getByLabel("Started from").fill(today);
  await view.getByLabel("Started until").fill(today);
  await shows(view, "run-2");
  const address = new URL(view.url());
  assert.equal(address.search, `?name=run&sort=opened_at&verdict=fault&from=${today}&to=${today}`);

  // Somebody else opens the address.
  const other = await page(chromium);
  await other.goto(address.href);
  await shows(other, "run-2");
  assert.equal(await other.getByLabel("Verdict").inputValue(), "fault");
  assert.equal(await other.getByLabel("Started from").inputValue(), today);
  await other.done();

  await view.getByLabel("Started from").fill("");
  await view.getByLabel("Started until").fill("2020-01-01");
  await view.getByText("No session matches").waitFor();
  await view.getByRole("link", { name: "Show all sessions" }).click();
  await shows(view, "trial", "run-2", "run-1");
  assert.equal(await view.getByLabel("Session", { exact: true }).inputValue(), "");
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("what is typed stays when the list is fetched again meanwhile", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  await shows(view, "trial", "run-2", "run-1");
  const fetched = async () => {
    const response = await view.waitForResponse(/\/api\/v1\/sessions\?/);
    await response.finished();
    await view.evaluate(
      () => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))),
    );
  };
  const name = view.getByLabel("Session", { exact: true });
  const asset = view.getByLabel("Rig", { exact: true });
  await name.fill("ru");
  await asset.pressSequentially("ben");
  await fetched();
  await asset.pressSequentially("ch");
  assert.equal(await asset.inputValue(), "bench");
  await asset.press("Enter");
  await view.waitForURL("**/sessions?name=ru&asset=bench");
  await name.fill("run-1");
  await fetched();
  assert.equal(await name.inputValue(), "run-1");
  await name.press("Enter");
  await shows(view, "run-1");

  // What is typed and undone does not hide the next value.
  await view.goto(`${service.url}/sessions?name=other`);
  await name.fill("others");
  await name.fill("other");
  await view.getByRole("link", { name: "Show all sessions" }).click();
  await shows(view, "trial", "run-2", "run-1");
  assert.equal(await name.inputValue(), "");

  // The dialogue is above the list.
  const buffer = Buffer.from(rig.healthy);
  await view.locator("input[type=file]").setInputFiles({ name: "more.csv", mimeType: "text/csv", buffer });
  await view.getByText("Mapping as a text").click();
  const mapping = view.getByLabel("Mapping of the columns");
  const text = `${await mapping.inputValue()}*1.5`;
  await mapping.fill(text);
  await fetched();
  assert.equal(await mapping.inputValue(), text);
  assert.deepEqual(view.errors, []);
  await view.done();
});
