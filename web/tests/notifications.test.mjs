// Channels and rules of notifications in the page.
import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after, test } from "node:test";
import { ask, page, started, until } from "./support.mjs";

let service, chromium, receiver;
const received = [];

started(async (made) => {
  ({ service, chromium } = made);
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

test("a rule is changed in the page, and what the form does not hold stays", async () => {
  const view = await page(chromium);
  await view.goto(`${service.url}/notifications`);
  await view.getByText("Messages have no link to the dashboard").waitFor();
  const before = (await ask(service.url, "GET", "/notifications/rules")).items[0];
  await view.getByRole("button", { name: "Edit everything" }).click();
  const dialog = view.getByRole("dialog", { name: "Edit the rule everything" });
  await dialog.getByLabel("Rigs").fill("bench*");
  await dialog.getByLabel("suspected").check();
  await dialog.getByLabel("Nothing is sent from").fill("22:00");
  assert.ok(await dialog.getByRole("button", { name: "Save" }).isDisabled(), "quiet hours without an end");
  await dialog.getByLabel(/^to \(/).fill("06:30");
  await dialog.getByRole("button", { name: "Save" }).click();
  await dialog.waitFor({ state: "detached" });
  await view.getByText(/not from 22:00 to 06:30 \(.+\)/).waitFor();
  const [rule] = (await ask(service.url, "GET", "/notifications/rules")).items;
  assert.deepEqual(
    [rule.id, rule.asset, rule.silent_until, rule.enabled, [...rule.changes].sort()],
    [before.id, "bench*", before.silent_until, true, ["confirmed", "passed", "pending"]],
  );
  assert.deepEqual([rule.quiet_hours.from, rule.quiet_hours.to], ["22:00", "06:30"]);
  assert.deepEqual(view.errors, []);
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
  await webhook.getByLabel("Format").selectOption({ label: "Slack, Mattermost" });
  await webhook.getByRole("button", { name: "Save" }).click();
  await webhook.waitFor({ state: "detached" });
  await view.getByText("/other").waitFor();
  assert.equal(await view.getByText(/^whsec_/).count(), 0, "the key is the one before");
  const before = received.length;
  await view.getByRole("button", { name: "Test workshop" }).click();
  await until(() => received.length > before);
  assert.match(received.at(-1).text, /^This is a test/, "as Slack takes it");

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
