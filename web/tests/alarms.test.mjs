// Alarms and mutes in the page.
import assert from "node:assert/strict";
import { test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started, until } from "./support.mjs";

/** The label of the field for the name that is recorded with an action. */
const ACTOR = "Your name, recorded with the action";

let work, service, chromium, learntRig, sickRows;

started(async (made) => {
  ({ work, service, chromium } = made);
  const { learnt, sick } = recordings(work);
  [learntRig, sickRows] = [learnt, sick];
  for (const name of ["bench", "shelf"]) {
    await ask(service.url, "POST", "/assets", { ...learnt, name });
    await imported(service.url, name, "monday", sick);
  }
});

test("alarms from before the page was opened are listed and acknowledged together", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/alarms`);
  for (const rig of ["bench", "shelf"])
    await view.getByRole("checkbox", { name: new RegExp(`X servo.* of ${rig}`) }).check();
  await view.getByLabel(ACTOR).fill("ada");
  await view.getByText("2 alarms").waitFor();
  const areAcknowledged = async (wanted) => {
    for (const rig of ["bench", "shelf"]) {
      const fault = await ask(service.url, "GET", `/assets/${rig}/faults/x_servo`);
      assert.equal(fault.acknowledged, wanted, rig);
    }
  };
  // It can be taken back for a while.
  const acknowledge = view.getByRole("button", { name: "Acknowledge 2" });
  await acknowledge.click();
  await view.getByText("Acknowledging 2 alarms.").waitFor();
  await view.getByRole("button", { name: "Undo" }).click();
  await view.getByText("Acknowledging 2 alarms.").waitFor({ state: "detached" });
  await areAcknowledged(false);
  await acknowledge.click();
  await view.getByText("ada,").nth(1).waitFor();
  await areAcknowledged(true);
  await view.getByRole("checkbox", { name: "Unacknowledged only", exact: true }).check();
  await view
    .getByRole("link", { name: /X servo/ })
    .first()
    .waitFor({ state: "detached" });
  await view.done();
});

test("alarms are found by a part of the rig's name, ordered and grouped", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/alarms?sort=rig`);
  const rigs = () => view.locator("table.alarms tbody th[scope=row]").allTextContents();
  await until(async () => (await rigs()).join() === "bench,shelf");
  await view.getByLabel("Rig", { exact: true }).fill("HEL");
  await until(async () => (await rigs()).join() === "shelf");
  await view.getByText("1 alarm", { exact: true }).waitFor();
  await view.getByLabel("Rig", { exact: true }).fill("");
  await view.getByLabel("Group by").selectOption({ label: "Fault" });
  await view.getByRole("rowheader", { name: "X servo (2)" }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("the number of alarms that fail and that nobody has acknowledged is in the header and the title", async () => {
  await ask(service.url, "POST", "/assets", { ...learntRig, name: "badge" });
  await ask(service.url, "POST", "/assets", { ...learntRig, name: "unlearnt", calibration: null });
  const view = await page(chromium);
  await view.goto(`${service.url}/sessions`);
  const link = view.getByRole("navigation", { name: "Views" }).getByRole("link", { name: /^Alarms/ });
  const badge = async () => Number((await link.textContent()).replace("Alarms", "").trim());
  await link.waitFor();
  const before = await badge();
  const isShown = async (n) =>
    (await badge()) === n && (await view.title()) === `${n ? `(${n}) ` : ""}Sessions · offbd`;
  // Without a calibration, the fault is suspected only.
  await imported(service.url, "unlearnt", "monday", sickRows);
  await imported(service.url, "badge", "monday", sickRows);
  await until(() => isShown(before + 1));
  const { items } = await ask(service.url, "GET", "/alarms?state=suspected");
  assert.deepEqual(
    items.map(({ asset, code }) => [asset, code]),
    [["unlearnt", "x_servo"]],
  );
  const alarms = [{ asset: "badge", code: "x_servo" }];
  await ask(service.url, "POST", "/alarms/acknowledge", { alarms });
  await until(() => isShown(before));
  await view.goto(`${service.url}/alarms`);
  await view.getByLabel("State").selectOption({ label: "Suspected" });
  await view.getByRole("row", { name: /unlearnt X servo/ }).waitFor();
  await view.getByText("1 alarm", { exact: true }).waitFor();
  for (const name of ["badge", "unlearnt"]) await ask(service.url, "DELETE", `/assets/${name}`);
  await view.done();
});

test("what to do is told, and the owner's note is kept", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/alarms`);
  const row = view.getByRole("row", { name: /bench X servo/ });
  await row.getByText("What to do").click();
  await row.getByText("power").first().waitFor();
  await row.getByRole("button", { name: "Add a remark" }).click();
  await row.getByRole("textbox", { name: "Remark on every fault" }).fill("Spare horns are in the drawer.");
  await row.getByLabel(ACTOR).fill("ada");
  await row.getByRole("button", { name: "Save" }).click();
  await row.getByText("Spare horns are in the drawer.").waitFor();
  const { notes } = await ask(service.url, "GET", "/advice");
  assert.deepEqual(
    notes.map(({ code, text, by }) => [code, text, by]),
    [["x_servo", "Spare horns are in the drawer.", "ada"]],
  );
  // The pages of the fault, to which every link leads, tell the same.
  for (const path of ["/rigs/bench/faults/x_servo", "/rigs/bench/faults/x_servo/report"]) {
    await view.goto(service.url + path);
    await view.getByRole("heading", { name: "What to do" }).waitFor();
    await view.getByRole("listitem").getByText("power").first().waitFor();
    await view.getByText("Spare horns are in the drawer.").waitFor();
  }
  await view.emulateMedia({ media: "print" });
  assert.equal(await view.getByRole("button", { name: "Edit the remark" }).isVisible(), false);
  await view.done();
});

test("of two people who write a remark on a fault, or mute it, the second is told", async () => {
  const write = (view, text) => view.getByRole("textbox", { name: "Remark on every fault" }).fill(text);
  const open = async (button) => {
    const view = await page(chromium);
    await view.goto(`${service.url}/rigs/shelf/faults/x_servo`);
    await view.getByRole("button", { name: button }).click();
    return view;
  };
  const refused = async (view, words) => {
    await view.getByRole("button", { name: "Save" }).click();
    await view.getByText(words).waitFor();
    await view.done();
  };
  await ask(service.url, "PUT", "/advice/x_servo/note", { text: "" });
  const first = await open("Add a remark");
  await write(first, "from the page");
  await ask(service.url, "PUT", "/advice/x_servo/note", { text: "from a program" });
  await refused(first, "Somebody has changed this since the page showed it");
  const second = await open("Edit the remark");
  await write(second, "from the page");
  await ask(service.url, "PUT", "/advice/x_servo/note", { text: "" });
  await refused(second, "Somebody has deleted this since the page showed it");
  const { notes } = await ask(service.url, "GET", "/advice");
  assert.deepEqual(notes, []);
});

test("a rig that somebody deletes while its page is open is not shown any longer", async () => {
  await ask(service.url, "POST", "/assets", { ...learntRig, name: "gone" });
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/gone`);
  await view.getByRole("heading", { name: "From above" }).waitFor();
  await ask(service.url, "DELETE", "/assets/gone");
  await view.getByRole("alert").getByText("Somebody deleted it while this page was open").waitFor();
  await view.getByRole("link", { name: "Go to the fleet" }).click();
  await view.getByRole("heading", { name: "Fleet" }).waitFor();
  await view.done();
});

test("a muted monitor is shown as not tested by whom, never as passed", async () => {
  await ask(service.url, "POST", "/assets/bench/sessions", { name: "tuesday" });
  const view = await page(chromium);
  await view.goto(`${service.url}/rigs/bench`);
  await view.getByRole("button", { name: "Mute Y servo" }).click();
  await view.getByLabel("Why").fill("new horn");
  await view.getByRole("dialog").getByLabel(ACTOR).fill("ada");
  await view.getByRole("dialog").getByRole("button", { name: "Mute", exact: true }).click();
  await view.getByText("not tested (muted by ada)").waitFor();
  await view.getByRole("button", { name: /End the mute of Y servo/ }).waitFor();
  await view.goto(service.url);
  await view.getByText("Y servo not tested", { exact: true }).waitFor();
  await view.done();
});
