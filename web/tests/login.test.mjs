// The login of a service that requires a token.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { createRequire } from "node:module";
import { secured } from "./secured.mjs";
import { browser, directory, offbd, page, remove } from "./support.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

let work, service, chromium, view, admin, asks;

before(async () => {
  work = directory();
  chromium = await browser();
  ({ service, admin, asks } = await secured(work));
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

/** Simulates a session, imports it, and returns its id. */
async function imported(name, ...options) {
  const file = join(work, `${name}.csv`);
  offbd("simulate", "--seconds", "10", ...options, "-o", file);
  const answer = await fetch(`${service.url}/api/v1/assets/bench-1/sessions/import?name=${name}`, {
    method: "POST",
    headers: { authorization: `Bearer ${admin}`, "content-type": "text/csv" },
    body: readFileSync(file),
  });
  return (await answer.json()).session.id;
}

test("without authentication, only the login is shown", async () => {
  await view.getByLabel("Token").waitFor();
  assert.doesNotMatch(await view.textContent("body"), /bench-1/);
  const wrong = await view.evaluate(`${AXE}; axe.run().then((found) => found.violations.map((v) => v.id))`);
  assert.deepEqual(wrong, []);
  await view.getByLabel("Token").fill("offbd_wrong");
  await view.getByRole("button", { name: "Log in" }).click();
  await view.getByText("unknown, revoked or expired token").waitFor();
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

test("a device's snippet shows its own token", async () => {
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
  await view.goto(`${service.url}/sessions/${await imported("short")}`);
  await view.getByLabel("Remark", { exact: true }).waitFor();
  assert.equal(await view.getByLabel("Your name, recorded with the action").count(), 0);
  await view.goto(before);
});

/** The views with actions, each with the names of the buttons that a viewer may not press. */
const REFUSED = (session) => [
  ["/rigs/bench-1", ["Add tags", "End session", "Mute Y servo", /^End the mute of X servo/]],
  ["/rigs/bench-1/faults/sensor", ["Acknowledge", "Clear"]],
  ["/alarms", ["Acknowledge", "Add a remark"]],
  ["/rigs/bench-1/set-up?step=check", ["Positions are in mm", "Commands are in degrees"]],
  [`/sessions/${session}`, ["Add remark at this moment", "Judge again"]],
  ["/sessions", ["choose a file"]],
  ["/learn", ["Repair all", "Resume the script", /^Inject: Y servo, dead/]],
];

/** A session with a fault of the sensor, a muted monitor, and readings of a device with other units: 4 m, 172°. */
async function prepareForViewer() {
  const session = await imported("sick", "--fault", "sensor:frozen@4");
  const until = new Date(Date.now() + 3_600_000).toISOString();
  await asks("PUT", "/assets/bench-1/mutes/x_servo", admin, { reason: "new horn", until });
  const samples = Array.from({ length: 200 }, (_, i) => ({
    seq: i + 10,
    t_s: 1 + i / 100,
    cmd_qx_rad: 3,
    cmd_qy_rad: 3,
    x_m: i / 50,
    y_m: i / 50,
  }));
  const sent = await asks("POST", "/assets/bench-1/telemetry", admin, { samples });
  assert.equal((await sent.json()).accepted, samples.length);
  return session;
}

/** Lets the page see a service that is a demo. */
async function asDemo(view) {
  const health = await (await fetch(`${service.url}/healthz`)).json();
  await view.route("**/healthz", (route) => route.fulfill({ json: { ...health, demo: true } }));
  const demo = { asset: "bench-1", script: false, broken: [], buttons: ["y_servo:dead"] };
  await view.route("**/api/v1/demo", (route) => route.fulfill({ json: demo }));
  const gains = { kp: 1, ki: 0.1, kd: 0.5 };
  const tuning = { gains, initial: gains };
  await view.route("**/api/v1/demo/gains", (route) => route.fulfill({ json: tuning }));
}

test("an action that a viewer may not do is disabled and says which role it needs", async () => {
  const made = await asks("POST", "/tokens", admin, { name: "vi", role: "viewer" });
  const { secret } = await made.json();
  const session = await prepareForViewer();
  const viewers = await page(chromium);
  await asDemo(viewers);
  await viewers.goto(`${service.url}/rigs/bench-1`);
  await viewers.getByLabel("Token").fill(secret);
  await viewers.getByRole("button", { name: "Log in" }).click();
  await viewers.getByText("vi", { exact: true }).waitFor();
  for (const [path, names] of REFUSED(session)) {
    await viewers.goto(service.url + path);
    for (const name of names) {
      const button = viewers.getByRole("button", { name, exact: true, includeHidden: true }).first();
      await button.waitFor({ state: "attached" });
      const title = await button.getAttribute("title");
      assert.equal(title, "Needs the role operator; yours is viewer.", `${path}: ${name}`);
      assert.ok(await button.isDisabled(), `${path}: ${name}`);
    }
  }
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
