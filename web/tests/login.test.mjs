// The login of a service that requires a token.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { createRequire } from "node:module";
import { browser, directory, offbd, page, remove, serve } from "./support.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

let work, service, chromium, view, admin;

before(async () => {
  work = directory();
  chromium = await browser();
  const data = join(work, "data");
  admin = offbd("token", "create", "--name", "ann", "--role", "admin", "--data", data).trim();
  writeFileSync(join(work, "offbd.toml"), "auth = 'required'\n");
  service = await serve(data, 0, "--config", join(work, "offbd.toml"));
  const made = await asks("POST", "/assets", admin, { name: "bench-1" });
  assert.equal(made.status, 201);
  view = await page(chromium);
  await view.goto(`${service.url}/rigs/bench-1/set-up?step=connect`);
});

after(async () => {
  await chromium?.close();
  await service?.stop();
  remove(work);
});

const asks = (method, path, token, body) =>
  fetch(`${service.url}/api/v1${path}`, {
    method,
    headers: { authorization: `Bearer ${token}`, "content-type": "application/json" },
    body: JSON.stringify(body),
  });

test("without authentication, only the login is shown", async () => {
  await view.getByLabel("Token").waitFor();
  assert.doesNotMatch(await view.textContent("body"), /bench-1/);
  const wrong = await view.evaluate(`${AXE}; axe.run().then((found) => found.violations.map((v) => v.id))`);
  assert.deepEqual(wrong, []);
  await view.getByLabel("Token").fill("offbd_wrong");
  await view.getByRole("button", { name: "Log in" }).click();
  await view.getByText("the token is unknown, revoked or expired").waitFor();
});

test("a token opens the requested page", async () => {
  await view.getByLabel("Token").fill(admin);
  await view.getByRole("button", { name: "Log in" }).click();
  await view.getByRole("heading", { name: "Set up bench-1" }).waitFor();
  await view.getByText("ann", { exact: true }).waitFor();
  await view
    .getByRole("status")
    .getByText("live", { exact: true })
    .or(view.locator(".link-live"))
    .first()
    .waitFor();
  const [cookie] = await view.context().cookies();
  assert.deepEqual([cookie.httpOnly, cookie.sameSite], [true, "Strict"]);
  assert.equal(await view.evaluate("document.cookie"), "");
  assert.ok(!JSON.stringify(await view.evaluate("({ ...localStorage })")).includes(admin));
});

test("a device's snippet shows a token of its own", async () => {
  const snippet = view.getByRole("region", { name: "Python snippet" });
  assert.match(await snippet.textContent(), /Bearer offbd_TOKEN/);
  await view.getByRole("button", { name: "Create a token for this rig" }).click();
  await snippet.getByText(/Bearer offbd_[0-9a-f]{64}/).waitFor();
  const [token] = /offbd_[0-9a-f]{64}/.exec(await snippet.textContent());
  const sample = { seq: 1, t_s: 0, cmd_qx_rad: 0, cmd_qy_rad: 0, x_m: 0, y_m: 0 };
  const sent = await asks("POST", "/assets/bench-1/telemetry", token, { samples: [sample] });
  assert.equal((await sent.json()).accepted, 1);
  await view.getByText(/Receiving samples|Samples received/).waitFor();
  assert.equal((await asks("POST", "/assets", token, { name: "other" })).status, 403);
});

test("a token names the user, who is not asked for a name", async () => {
  const before = view.url();
  const file = join(work, "short.csv");
  offbd("simulate", "--seconds", "10", "-o", file);
  const imported = await fetch(`${service.url}/api/v1/assets/bench-1/sessions/import?name=short`, {
    method: "POST",
    headers: { authorization: `Bearer ${admin}`, "content-type": "text/csv" },
    body: readFileSync(file),
  });
  await view.goto(`${service.url}/sessions/${(await imported.json()).session.id}`);
  await view.getByLabel("Remark", { exact: true }).waitFor();
  assert.equal(await view.getByLabel("Your name, recorded with the action").count(), 0);
  await view.goto(before);
});

test("an action that a viewer may not do is disabled and says which role it needs", async () => {
  const made = await asks("POST", "/tokens", admin, { name: "vi", role: "viewer" });
  const { secret } = await made.json();
  await asks("POST", "/assets/bench-1/telemetry", admin, { samples: [{ t_s: 0, x_m: 0, y_m: 0 }] });
  const viewers = await page(chromium);
  await viewers.goto(`${service.url}/rigs/bench-1`);
  await viewers.getByLabel("Token").fill(secret);
  await viewers.getByRole("button", { name: "Log in" }).click();
  const end = viewers.getByRole("button", { name: "End session" });
  await end.waitFor();
  assert.equal(await end.getAttribute("title"), "Needs the role operator; yours is viewer.");
  assert.ok(await end.isDisabled());
  assert.deepEqual(
    viewers.errors.filter((error) => !error.includes("401")),
    [],
  );
  await viewers.done();
});

test("after the logout, the login is shown again", async () => {
  await view.getByRole("button", { name: "Log out" }).click();
  await view.getByLabel("Token").waitFor();
  await view.reload();
  await view.getByLabel("Token").waitFor();
});
