// The page of administrators: tokens and the audit log; and how a rig is deleted.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { secured } from "./secured.mjs";
import { ask, browser, directory, page, remove, serve } from "./support.mjs";

let work, service, chromium, admin, asks;

before(async () => {
  work = directory();
  chromium = await browser();
  ({ service, admin, asks } = await secured(work));
  for (const name of ["bench-1", "bench-2"]) await asks("POST", "/assets", admin, { name });
});

after(async () => {
  await chromium?.close();
  await service?.stop();
  remove(work);
});

/** Opens the page as the holder of a token. */
async function loggedIn(token, path) {
  const view = await page(chromium);
  await view.goto(service.url + path);
  await view.getByLabel("Token").fill(token);
  await view.getByRole("button", { name: "Log in" }).click();
  return view;
}

/** The errors of the page, without that of the first request, which has no login yet. */
const errorsOf = (view) => view.errors.filter((error) => !error.includes("401"));

test("a token is created, shown once, used, and revoked after a question", async () => {
  const view = await loggedIn(admin, "/");
  await view.getByRole("link", { name: "Administration" }).click();
  await view.getByRole("rowheader", { name: "ann", exact: true }).first().waitFor();
  await view.getByRole("button", { name: "Create a token" }).click();
  const form = view.getByRole("dialog");
  await form.getByText("Give it a name.").waitFor();
  assert.ok(await form.getByRole("button", { name: "Create" }).isDisabled());
  await form.getByLabel("Name").fill("camera of bench-1");
  await form.getByLabel("Role").selectOption({ label: "device: sends the samples of one rig" });
  await form.getByText("Choose the rig of the device.").waitFor();
  await form.getByLabel("Rig", { exact: true }).fill("bench-1");
  await form.getByLabel("Expires").fill("2090-01-01T12:00");
  await form.getByRole("button", { name: "Create" }).click();

  const secret = await view.getByRole("region", { name: "Secret of camera of bench-1" }).textContent();
  assert.match(secret, /^offbd_[0-9a-f]{64}$/);
  const send = (asset) => asks("POST", `/assets/${asset}/telemetry`, secret, { samples: [{ t_s: 0 }] });
  assert.deepEqual([(await send("bench-1")).status, (await send("bench-2")).status], [200, 403]);
  await view.getByRole("button", { name: "I have copied it" }).click();
  const row = view.getByRole("row", { name: /^camera of bench-1/ });
  await row.getByText("device of bench-1").waitFor();
  await row.getByText(/valid until .*2090/).waitFor();
  assert.ok(!(await view.textContent("body")).includes(secret));

  await row.getByRole("button", { name: "Revoke camera of bench-1" }).click();
  await view.getByText("Its holder is logged out and refused at once").waitFor();
  assert.equal((await send("bench-1")).status, 200, "nothing is done before the answer");
  await view.getByRole("dialog").getByRole("button", { name: "Revoke" }).click();
  await row.waitFor({ state: "detached" });
  assert.equal((await send("bench-1")).status, 401);
  await view.getByLabel("Also those that are revoked or have expired").check();
  await row.getByText(/^revoked/).waitFor();
  assert.deepEqual(errorsOf(view), []);
  await view.done();
});

test("the audit log names who did what, in pages", async () => {
  for (let i = 0; i < 60; i++) await asks("PUT", "/assets/bench-2/tags", admin, { tags: [`n${i}`] });
  const view = await loggedIn(admin, "/administration");
  const log = view.locator("section", { has: view.getByRole("heading", { name: "Audit log" }) });
  await log
    .getByRole("row", { name: /ann change tags rig bench-2/ })
    .first()
    .waitFor();
  const revoked = log.getByRole("row", { name: /ann revoke token token camera of bench-1/ });
  assert.equal(await revoked.count(), 0, "it is on a later page");
  await log.getByRole("button", { name: "Show more" }).click();
  await revoked.waitFor();
  await log.getByRole("link", { name: "rig bench-2" }).first().click();
  await view.getByRole("heading", { name: /bench-2/ }).waitFor();
  assert.deepEqual(errorsOf(view), []);
  await view.done();
});

test("a viewer is told which role is needed, and cannot delete a rig", async () => {
  const made = await asks("POST", "/tokens", admin, { name: "vi", role: "viewer" });
  const view = await loggedIn((await made.json()).secret, "/administration");
  await view.getByText("for administrators. Needs the role admin; yours is viewer.").waitFor();
  assert.equal(await view.getByRole("link", { name: "Administration" }).count(), 0);
  await view.goto(`${service.url}/rigs/bench-2`);
  const button = view.getByRole("button", { name: "Delete this rig" });
  await button.waitFor();
  assert.equal(await button.getAttribute("title"), "Needs the role admin; yours is viewer.");
  assert.ok(await button.isDisabled());
  assert.deepEqual(errorsOf(view), []);
  await view.done();
});

test("a rig is deleted after a question that says what is lost", async () => {
  const view = await loggedIn(admin, "/rigs/bench-2");
  await view.getByRole("button", { name: "Delete this rig" }).click();
  const question = view.getByRole("dialog", { name: "Delete bench-2?" });
  await question.getByText("with all its sessions").waitFor();
  await question.getByRole("button", { name: "Cancel" }).click();
  assert.equal((await asks("GET", "/assets/bench-2", admin)).status, 200);
  await view.getByRole("button", { name: "Delete this rig" }).click();
  await question.getByRole("button", { name: "Delete this rig" }).click();
  await view
    .getByRole("list", { name: "Rigs" })
    .getByRole("link", { name: /bench-1/ })
    .waitFor();
  assert.equal(new URL(view.url()).pathname, "/");
  assert.equal((await asks("GET", "/assets/bench-2", admin)).status, 404);
  // The page may have asked for the rig at the moment at which it was deleted.
  assert.deepEqual(
    errorsOf(view).filter((error) => !/status of 404/.test(error)),
    [],
  );
  await view.done();
});

test("whoever revokes the own token is warned, and logged out", async () => {
  const made = await asks("POST", "/tokens", admin, { name: "eve", role: "admin" });
  const view = await loggedIn((await made.json()).secret, "/administration");
  await view.getByRole("button", { name: "Revoke ann" }).waitFor();
  await view.getByRole("button", { name: "Revoke eve" }).click();
  await view.getByText("you will be logged out").waitFor();
  await view.getByRole("dialog").getByRole("button", { name: "Revoke" }).click();
  await view.getByLabel("Token").waitFor();
  await view.done();
});

test("a service without authentication says that tokens are not asked for", async () => {
  const open = await serve(directory());
  await ask(open.url, "POST", "/tokens", { name: "early", role: "viewer" });
  const view = await page(chromium);
  await view.goto(`${open.url}/administration`);
  await view.getByText("The service requires no token at present").waitFor();
  await view.getByRole("rowheader", { name: "early" }).waitFor();
  assert.deepEqual(view.errors, []);
  await view.done();
  await open.stop();
});
