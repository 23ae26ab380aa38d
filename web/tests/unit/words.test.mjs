// The texts of codes, statuses and verdicts.
import assert from "node:assert/strict";
import { test } from "node:test";
import { faultMark } from "../../src/parts/charts/fault-marks.ts";
import { refusal } from "../../src/parts/login/rights.ts";
import { dimensions, hasDefaultDimensions } from "../../src/words/dimensions.ts";
import { changeOf, chipClass, stateText } from "../../src/words/fault-state.ts";
import { jobText } from "../../src/words/job.ts";
import { deliverySummary, lineSentence, sentence } from "../../src/words/sentence.ts";
import { healthByFaults, severity } from "../../src/words/severity.ts";
import { isFailing, STATUS_BITS } from "../../src/words/status-byte.ts";
import { ambiguousCauses, judgedShare, verdict } from "../../src/words/verdict.ts";

test("a job that waits tells for what, another one what it does", () => {
  assert.equal(jobText({ waits: null }, "Judging"), "Judging…");
  assert.equal(jobText({ waits: { reason: "jobs", n_before: 0 } }, "Judging"), "Judging…");
  assert.equal(jobText({ waits: { reason: "jobs", n_before: 1 } }, "Judging"), "Waiting for 1 other job…");
  const samples = { reason: "samples", n_before: 0 };
  assert.equal(jobText({ waits: samples }, "Calibrating"), "Waiting until fewer samples are queued…");
});

test("severity decreases from failing over acknowledged and pending to on record", () => {
  const order = [
    { status: "confirmed", failing: true },
    { status: "confirmed", failing: true, acknowledged: true },
    { status: "pending", failing: true },
    { status: "confirmed", failing: false },
    { status: "healed", failing: false },
  ];
  const severities = order.map(severity);
  assert.deepEqual(
    [...severities].sort((a, b) => b - a),
    severities,
  );
  assert.equal(new Set(severities).size, order.length);
  assert.equal(severities.at(-1), 0);
  assert.equal(healthByFaults(order), "fault");
  assert.equal(healthByFaults(order.slice(1)), "fault", "acknowledged, but it fails");
  assert.equal(healthByFaults(order.slice(2)), "suspect");
  assert.equal(healthByFaults(order.slice(3)), "recorded", "it passes again");
  assert.equal(healthByFaults([]), undefined);
});

test("a fault that fails now, one on record and an acknowledged one look different", () => {
  const fails = { status: "confirmed", failing: true, tested: true };
  const passes = { status: "confirmed", failing: false, tested: true };
  assert.equal(stateText(fails), "failing");
  assert.equal(stateText(fails, "arriving", "6:09"), "failing since 6:09");
  assert.equal(stateText(fails, "ended"), "failed when last tested", "no session is open");
  assert.equal(stateText(fails, "silent"), "failed when last tested; now silent");
  assert.equal(stateText(fails, "silent", "6:09"), "failed 6:09, when last tested; now silent");
  assert.equal(
    stateText({ ...fails, status: "pending" }, "silent", "6:09"),
    "suspected 6:09, when last tested; now silent",
  );
  const earlier = { ...fails, tested: false };
  assert.equal(stateText(earlier), "failed when last tested", "in a session before the open one");
  assert.equal(stateText({ ...earlier, status: "pending" }), "suspected when last tested");
  assert.equal(stateText(passes), "was confirmed, passes again");
  assert.equal(
    stateText({ ...passes, status: "pending" }, "arriving", "6:09"),
    "suspected 6:09, passes again",
  );
  assert.equal(stateText({ ...fails, acknowledged: true }), "failing, acknowledged");
  assert.equal(stateText({ status: "cleared", failing: false, acknowledged: true }), "cleared");
  const looks = [fails, passes, { ...fails, acknowledged: true }, { status: "pending", failing: true }];
  assert.equal(new Set(looks.map(chipClass)).size, looks.length);
});

test("a test that passes again is told as a repair and not as an alarm", () => {
  const line = { code: "x_servo", status: "confirmed", t_s: 2, summary: "x_servo confirmed: it is dead" };
  const fails = { ...line, status_byte: "2F" };
  const passes = { ...line, status_byte: "2E", summary: "x_servo (dead) passes its test again" };
  assert.deepEqual(changeOf(fails), { text: "confirmed", look: "status-confirmed" });
  assert.deepEqual(changeOf(passes), { text: "passes again", look: "status-passed" });
  assert.deepEqual(changeOf({ ...passes, status: "healed" }), { text: "healed", look: "status-healed" });
  assert.equal(lineSentence(fails), "It is dead.");
  assert.equal(lineSentence(passes), "Passing again; was confirmed.");
  assert.equal(faultMark(fails).label, "X servo confirmed");
  assert.deepEqual(faultMark({ ...passes, axis: "x" }), {
    t: 2,
    axis: "x",
    label: "X servo passes again",
    colour: "good",
  });
});

test("dimensions are named, and the defaults recognized", () => {
  const asset = { ball: { radius_m: 0.0127 }, plate: { length_m: 0.38, width_m: 0.24 } };
  assert.match(dimensions(asset), /ball radius 12\.7.*plate 380.* × 240/);
  assert.ok(hasDefaultDimensions(asset));
  assert.ok(!hasDefaultDimensions({ ...asset, ball: { radius_m: 0.02 } }));
  assert.match(dimensions({ ...asset, plate: { diameter_m: 0.3 } }), /round plate 300/);
});

test("a button says which role it needs", () => {
  assert.equal(refusal("operator", "viewer"), "Needs the role operator; yours is viewer.");
  assert.equal(refusal("admin", "operator"), "Needs the role admin; yours is operator.");
  assert.equal(refusal("operator", "admin"), undefined);
  assert.equal(refusal(undefined, "viewer"), undefined);
});

test("a summary becomes a sentence without its code", () => {
  assert.equal(sentence("x_servo: gain is -0.5, expected 1"), "Gain is −0.5, expected 1.");
  assert.equal(sentence("well-known words"), "Well-known words.");
});

test("the lowest bit of the status byte says whether the test fails", () => {
  assert.equal(isFailing({ status_byte: "0x2F" }), true);
  assert.equal(isFailing({ status_byte: "0x2E" }), false);
  assert.deepEqual(
    STATUS_BITS.map(({ bit }) => bit),
    [7, 6, 5, 4, 3, 2, 1, 0],
  );
});

test("candidates in different parts of the rig are named with their weights", () => {
  const x = { code: "x_servo", kind: "gain", weight: 0.7 };
  const y = { code: "y_servo", weight: 0.3 };
  assert.equal(ambiguousCauses([x, y]), "Cannot tell: X servo (gain) 70 % or Y servo 30 %");
  assert.equal(ambiguousCauses([x, { ...x, kind: "offset" }]), "", "two kinds in the same part");
  assert.equal(ambiguousCauses([]), "");
});

/** A summary with monitors of these outcomes. */
const summary = (outcomes, faults = [], outcome = "judged") => ({
  outcome,
  faults,
  monitors: Object.entries(outcomes).map(([code, outcome]) => ({ code, outcome, candidates: [] })),
});

test("a verdict lists the faults and the monitors without a result", () => {
  const passed = { x_servo: "no fault", sensor: "no fault" };
  const cases = [
    [summary(passed), "No fault", "status-ok"],
    [
      summary({ ...passed, x_servo: "not learnt" }),
      "No fault: Position sensor; not calibrated: X servo",
      "quiet",
    ],
    [
      summary({ x_servo: "not learnt", sensor: "not judged" }),
      "Not calibrated: X servo; not judged: Position sensor",
      "quiet",
    ],
    [summary({ ...passed, x_servo: "pending" }), "Suspected only: X servo", "status-pending"],
    [summary(passed, ["x_servo", "y_servo"]), "X servo, Y servo", "status-confirmed"],
    [
      summary({ sensor: "not judged" }, ["x_servo"]),
      "X servo; not judged: Position sensor",
      "status-confirmed",
    ],
    [summary({}, [], "not judged"), "Not judged", "quiet"],
  ];
  for (const [of, text, look] of cases) assert.deepEqual(verdict(of), { text, look });
  const book = verdict(summary({ x_servo: "no fault", sensor: "not judged" }), [], "textbook");
  assert.equal(book.text, "No fault: X servo; no test in this profile: Position sensor");
});

test("an ambiguous fault is shown with its candidates", () => {
  const of = summary({ x_servo: "cannot tell" }, ["x_servo"]);
  of.monitors[0].candidates = [
    { code: "x_servo", weight: 0.5 },
    { code: "stuck_ball", weight: 0.5 },
  ];
  assert.equal(verdict(of).text, "Cannot tell: X servo 50 % or Stuck ball 50 %");
});

test("a fault that a wrong unit explains as well is not told as one", () => {
  const { text } = verdict(summary({ x_servo: "fault" }, ["x_servo"], "cannot tell"));
  assert.equal(text, "Cannot tell a wrong unit from X servo");
});

test("a judged share has its duration", () => {
  assert.equal(judgedShare({ judged_share: 0.456, judged_s: 119.6 }), "46 %, 2\u202fmin 0\u202fs");
  assert.equal(judgedShare({}), "0 %, 0.0\u202fs");
});

test("a message is told without codes and times of the interface", () => {
  const text = deliverySummary("my_x_servo-1: x_servo (dead) confirmed since 4.50 s: qy asks for -0.2 m/s²");
  assert.equal(text, "my_x_servo-1: X servo (dead) confirmed since 4.50 s: qy asks for −0.2 m/s²");
  assert.doesNotMatch(deliverySummary("a: last heard 2026-11-25T20:02:59.031397Z"), /T20/);
});
