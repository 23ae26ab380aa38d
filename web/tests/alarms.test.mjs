// Alarms, mutes and notifications in the page.
import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after, test } from "node:test";
import { imported, recordings } from "./rigs.mjs";
import { ask, page, started, until } from "./support.mjs";

/** The label of the field for the name that is recorded with an action. */
const ACTOR = "Your name, recorded with the action";

let work, service, chromium, receiver;
const received = [];

started(async (made) => {
  ({ work, service, chromium } = made);
  const { learnt, sick } = recordings(work);
  for (const name of ["bench", "shelf"]) {
    await ask(service.url, "POST", "/assets", { ...learnt, name });
    await imported(service.url, name, "monday", sick);
  }
  receiver = createServer((request, answer) => {
    let body = "";
    request.on("data", (part) => (body += part));
    request.on("end", () => {
      received.push(JSON.parse(body));
      answer.end();
    });
  });
  await new Promise((done) => receiver.listen(0, "127.0.0.1", done));
});

after(() => receiver?.close());

test("alarms from before the page was opened are listed and acknowledged together", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/alarms`);
  for (const rig of ["bench", "shelf"])
    await view.getByRole("checkbox", { name: new RegExp(`X servo.* of ${rig}`) }).check();
  await view.getByLabel(ACTOR).fill("ada");
  await view.getByRole("button", { name: "Acknowledge 2" }).click();
  await view.getByText("ada,").nth(1).waitFor();
  for (const rig of ["bench", "shelf"]) {
    const fault = await ask(service.url, "GET", `/assets/${rig}/faults/x_servo`);
    assert.equal(fault.acknowledged, true, rig);
  }
  await view.getByRole("checkbox", { name: "Unacknowledged only", exact: true }).check();
  await view
    .getByRole("link", { name: /X servo/ })
    .first()
    .waitFor({ state: "detached" });
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

test("a channel and a rule are made in the page, and a test message arrives", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/notifications`);
  await view.getByText("no notifications are sent").waitFor();
  await view.getByRole("button", { name: "Add a channel" }).click();
  await view.getByLabel("Name").fill("workshop");
  await view.getByLabel("URL").fill(`http://127.0.0.1:${receiver.address().port}/hook`);
  await view.getByRole("button", { name: "Add", exact: true }).click();
  await view.getByText(/^whsec_/).waitFor();
  await view.getByRole("button", { name: "Test workshop" }).click();
  await view.getByText("delivered").waitFor();
  assert.equal(received[0].type, "org.offbd.test.v1");
  await view.getByRole("button", { name: "Add a rule" }).click();
  const { y, height } = await view.getByRole("dialog").boundingBox();
  assert.ok(Math.abs(y + height / 2 - 400) < 100, `the dialog is in the middle: ${y}, ${height}`);
  await view.getByLabel("Name").fill("everything");
  await view.getByRole("button", { name: "Add", exact: true }).click();
  await view.getByRole("button", { name: "Mute 8 h" }).click();
  await view.getByText("muted until").waitFor();
  const [rule] = (await ask(service.url, "GET", "/notifications/rules")).items;
  assert.deepEqual([rule.name, rule.asset, rule.channel_name], ["everything", "*", "workshop"]);
  assert.ok(Date.parse(rule.silent_until) > Date.now());
  await view.done();
});

test("a channel is changed in the page, and its secrets stay and are not shown", async () => {
  const password = "correct horse";
  const email = { host: "127.0.0.1", port: 2525, security: "none", from: "offbd@bench", to: ["ada@bench"] };
  const mail = { name: "mail", email: { ...email, user: "offbd", password } };
  const mailId = (await ask(service.url, "POST", "/notifications/channels", mail)).id;
  const view = await page(chromium);
  await view.goto(`${service.url}/notifications`);
  const edit = async (name) => {
    await view.getByRole("button", { name: `Edit ${name}` }).click();
    return view.getByRole("dialog", { name: `Edit the channel ${name}` });
  };
  const webhook = await edit("workshop");
  assert.match(await webhook.getByLabel("URL").inputValue(), /\/hook$/);
  await webhook.getByLabel("URL").fill(`http://127.0.0.1:${receiver.address().port}/other`);
  await webhook.getByRole("button", { name: "Save" }).click();
  await webhook.waitFor({ state: "detached" });
  await view.getByText("/other").waitFor();
  assert.equal(await view.getByText(/^whsec_/).count(), 0, "the key is the one before");
  const before = received.length;
  await view.getByRole("button", { name: "Test workshop" }).click();
  await until(() => received.length > before);

  const dialog = await edit("mail");
  assert.equal(await dialog.getByLabel("User").inputValue(), "offbd");
  assert.equal(await dialog.getByLabel("New password").inputValue(), "");
  assert.equal(await dialog.getByLabel("To").inputValue(), "ada@bench");
  await dialog.getByLabel("To").fill("ada@bench, bob@bench");
  await dialog.getByRole("button", { name: "Save" }).click();
  await dialog.waitFor({ state: "detached" });
  await view.getByText("ada@bench, bob@bench by 127.0.0.1:2525").waitFor();
  assert.ok(!(await view.content()).includes(password));
  const channel = await ask(service.url, "GET", `/notifications/channels/${mailId}`);
  assert.deepEqual(channel.email, {
    ...email,
    to: ["ada@bench", "bob@bench"],
    user: "offbd",
    has_password: true,
  });
  await ask(service.url, "DELETE", `/notifications/channels/${mailId}`);
  assert.deepEqual(view.errors, []);
  await view.done();
});

test("on a phone, nothing of a channel, rule or message is off the screen", async () => {
  const view = await page(chromium, { viewport: { width: 390, height: 800 } });
  await view.goto(`${service.url}/notifications`);
  await view.getByText("workshop").first().waitFor();
  await view.getByText("everything").first().waitFor();
  const cut = () =>
    [...document.querySelectorAll(".scroll")]
      .map((box) => box.scrollWidth - box.clientWidth)
      .filter((px) => px > 0);
  assert.deepEqual(await view.evaluate(cut), []);
  await view.done();
});

test("a rule and a channel are deleted after a question", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/notifications`);
  for (const [kind, name] of [
    ["rule", "everything"],
    ["channel", "workshop"],
  ]) {
    const listed = async () => (await ask(service.url, "GET", `/notifications/${kind}s`)).items.length;
    const dialog = view.getByRole("dialog", { name: `Delete the ${kind} ${name}?` });
    await view.getByRole("button", { name: `Delete ${name}` }).click();
    await dialog.getByRole("button", { name: "Cancel" }).click();
    await dialog.waitFor({ state: "detached" });
    assert.equal(await listed(), 1);
    await view.getByRole("button", { name: `Delete ${name}` }).click();
    await dialog.getByRole("button", { name: "Delete" }).click();
    await view.getByRole("button", { name: `Delete ${name}` }).waitFor({ state: "detached" });
    assert.equal(await listed(), 0);
  }
  assert.deepEqual(view.errors, []);
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
