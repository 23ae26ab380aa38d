// The logic of the set-up: the form, the choice of sessions, the calibration, the snippets.
import assert from "node:assert/strict";
import { test } from "node:test";
import { assetOf, DEGREE, describeAsset, isName } from "../../src/pages/set-up/description.ts";
import { proposedSessions, totalLength, withChoice } from "../../src/pages/set-up/chosen-sessions.ts";
import { falseAlarmRate } from "../../src/pages/set-up/false-alarm-rate.ts";
import { isDone } from "../../src/pages/set-up/is-done.ts";
import { learnFrom } from "../../src/pages/set-up/learn-from.ts";
import { snippets, unitsOf } from "../../src/pages/set-up/snippets.ts";
import { random } from "./random.mjs";

test("a new rig is described as that of the book chapter", () => {
  const description = describeAsset();
  assert.equal(description.name, "");
  assert.deepEqual([description.radius, description.mass, description.rate], [12.7, 51, 100]);
  const { plate, axes } = assetOf({ ...description, name: "bench" });
  assert.deepEqual(plate, { thickness_m: 0.003, rim: true, length_m: 0.38, width_m: 0.24 });
  assert.deepEqual([axes.swap, axes.x_sign, axes.position_unit_m], [false, 1, 1]);
});

test("an asset converts back to the description that it was made from", () => {
  const next = random(5);
  const typed = (most) => Number((next() * most).toPrecision(4));
  for (let i = 0; i < 200; i++) {
    const description = {
      name: `rig-${i}`,
      rate: typed(500),
      radius: typed(40),
      mass: typed(300),
      inertia: typed(1),
      isRound: next() < 0.5,
      length: typed(900),
      width: typed(900),
      diameter: typed(900),
      hasRim: next() < 0.5,
      limit: typed(60),
      positionUnit: [1, 0.001, 0.01][i % 3],
      commandUnit: [1, DEGREE][i % 2],
      debounce: [NaN, 0, typed(60)][i % 3],
      falseAlarms: [NaN, typed(100)][i % 2],
    };
    const back = describeAsset(assetOf(description));
    // Only the dimensions of the chosen shape are kept.
    const { length, width, diameter } = back;
    const kept = description.isRound ? { length, width } : { diameter };
    assert.deepEqual(back, { ...description, ...kept });
  }
});

test("properties that are not in the form keep their values", () => {
  const before = {
    name: "bench",
    plate: { thickness_m: 0.005, diameter_m: 0.3, rim: false },
    servo: { angle_limit_rad: 0.3, rate_limit_rad_s: 4 },
    axes: { swap: true, x_sign: -1 },
    diagnostics: { profile: "textbook" },
  };
  const after = assetOf({ ...describeAsset(before), limit: 10 }, before);
  assert.deepEqual(after.plate, before.plate);
  assert.deepEqual(after.servo, { angle_limit_rad: 10 * DEGREE, rate_limit_rad_s: 4 });
  const unchanged = assetOf(describeAsset(before), before);
  assert.equal(unchanged.servo.angle_limit_rad, 0.3, "to the bit, although the form rounds it");
  assert.equal(assetOf(describeAsset()).servo.angle_limit_rad, 0.2);
  assert.deepEqual([after.axes.swap, after.axes.x_sign, after.axes.y_sign], [true, -1, 1]);
  assert.deepEqual(after.diagnostics, before.diagnostics);
});

test("a setting of the diagnosis that is emptied is that of the service again", () => {
  const before = { name: "bench", diagnostics: { debounce_s: 0, false_alarms_per_rig_year: 5 } };
  const description = describeAsset(before);
  assert.deepEqual([description.debounce, description.falseAlarms], [0, 5]);
  assert.deepEqual(assetOf({ ...description, falseAlarms: NaN }, before).diagnostics, { debounce_s: 0 });
  assert.equal(assetOf({ ...description, debounce: NaN, falseAlarms: NaN }, before).diagnostics, undefined);
});

test("a name has letters, digits, dash, underline and point", () => {
  for (const name of ["bench-1", "A.b_c", "x".repeat(128)]) assert.ok(isName(name), name);
  for (const name of ["", "bench 1", "a/b", "ä", "x".repeat(129)]) assert.ok(!isName(name), name);
});

const session = (id, length, more = {}) => ({ id, first_t_s: 0, last_t_s: length, state: "ended", ...more });

test("the newest session is proposed if it is a minute long and has no fault", () => {
  const proposed = (...sessions) => [...proposedSessions(sessions)];
  assert.deepEqual(proposed(session("new", 60), session("old", 90)), ["new"]);
  assert.deepEqual(proposed(session("new", 59), session("old", 90)), []);
  assert.deepEqual(proposed(session("new", 60, { verdict: { faults: ["sensor"] } })), []);
  assert.deepEqual(proposed(session("new", null)), []);
  assert.deepEqual([...proposedSessions()], []);
});

test("a choice changes by one session, and its duration is that of its sessions", () => {
  const chosen = new Set(["a", "b"]);
  assert.deepEqual([...withChoice(chosen, "c", true)], ["a", "b", "c"]);
  assert.deepEqual([...withChoice(chosen, "a", false)], ["b"]);
  assert.deepEqual([...chosen], ["a", "b"], "unchanged");
  assert.equal(totalLength([session("a", 30), session("b", null), session("c", 40)], chosen), 30);
});

/** Replaces `fetch` by one that returns `answers`, for the user ann; returns the requests. */
function fakeService(answers) {
  const requests = [];
  globalThis.localStorage = { getItem: () => "ann" };
  globalThis.fetch = (path, { method = "GET", body } = {}) => {
    requests.push([method, path.replace("/api/v1", ""), ...(body ? [JSON.parse(body)] : [])]);
    return Promise.resolve(Response.json(answers.shift()));
  };
  return requests;
}

test("learning ends the open sessions, waits for the job, and activates the calibration", async () => {
  const job = (state) => ({ id: "7", state });
  const requests = fakeService([{}, job("queued"), job("running"), job("done"), job("done")]);
  const shown = [];
  const sessions = [
    session("a", 60, { state: "open" }),
    session("b", 60),
    session("c", 60, { state: "open" }),
  ];
  assert.equal(await learnFrom("bench", ["a", "b"], sessions, ({ state }) => shown.push(state)), true);
  assert.deepEqual(requests, [
    ["POST", "/sessions/a/end"],
    ["POST", "/assets/bench/calibrations?by=ann", { sessions: ["a", "b"] }],
    ["GET", "/assets/bench/calibrations/7"],
    ["GET", "/assets/bench/calibrations/7"],
    ["POST", "/assets/bench/calibrations/7/activate?by=ann"],
  ]);
  assert.deepEqual(shown, ["queued", "running", "done", "done"]);
});

test("a failed calibration is not activated", async () => {
  const requests = fakeService([
    { id: "7", state: "queued" },
    { id: "7", state: "failed", error: "it rested" },
  ]);
  let last;
  assert.equal(await learnFrom("bench", ["b"], [session("b", 60)], (job) => (last = job)), false);
  assert.equal(last.error, "it rested");
  assert.equal(requests.length, 2);
});

test("rates of false alarms are in the most readable unit", () => {
  assert.equal(falseAlarmRate(null), "unknown");
  assert.equal(falseAlarmRate(2), "fewer than 2.0 per hour");
  assert.equal(falseAlarmRate(0.5), "fewer than 12.0 per day");
  assert.equal(falseAlarmRate(0.9 / 24), "fewer than 0.9 per day", "not one in 1 days");
  assert.equal(falseAlarmRate(0.5 / 24), "fewer than one in 2 days");
  assert.equal(falseAlarmRate(1 / 24 / 10), "fewer than one in 10 days");
});

test("snippets have the address of the rig, with a placeholder for localhost on other machines", () => {
  const [curl, python, arduino] = snippets("bench 1", "http://127.0.0.1:8087");
  for (const { text } of [curl, python]) {
    assert.match(text, /http:\/\/127\.0\.0\.1:8087\/api\/v1\/assets\/bench%201\/telemetry/);
  }
  assert.match(arduino.text, /"http:\/\/SERVER:8087\/api\/v1\/assets\/bench%201\/telemetry"/);
  const [, , elsewhere] = snippets("bench-1", "https://rigs.example");
  assert.match(elsewhere.text, /"https:\/\/rigs\.example\/api/);
});

test("snippets contain a token only if the service requires one", () => {
  for (const { language, text } of snippets("bench-1", "http://host", "offbd_secret")) {
    assert.match(text, /authorization"?[:,] ?"?Bearer offbd_secret/, language);
  }
  for (const { language, text } of snippets("bench-1", "http://host")) {
    assert.doesNotMatch(text, /authorization|undefined/, language);
  }
});

test("steps are ticked off as they are done", () => {
  const steps = ["describe", "connect", "check", "learn"];
  const done = (...of) => steps.filter((step) => isDone(step, ...of));
  assert.deepEqual(done(undefined, false), []);
  assert.deepEqual(done({ calibration: null }, false), ["describe"]);
  assert.deepEqual(done({ calibration: null }, true), ["describe", "connect"]);
  assert.deepEqual(done({ calibration: {} }, false), steps);
});

test("snippets name the units of the rig's description", () => {
  assert.deepEqual(unitsOf({}), { angle: "rad", length: "m" });
  const units = unitsOf({ axes: { position_unit_m: 0.001, command_unit_rad: DEGREE } });
  assert.deepEqual(units, { angle: "degrees", length: "mm" });
  for (const { language, text } of snippets("bench-1", "http://host", undefined, units)) {
    assert.match(text, /degrees/, language);
    assert.match(text, /\bmm\b/, language);
  }
});
