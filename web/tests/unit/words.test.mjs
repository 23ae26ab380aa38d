// The texts of codes, statuses and verdicts.
import assert from "node:assert/strict";
import { test } from "node:test";
import { codeTitle, faultTitle, kindMeaning } from "../../src/words/fault-names.ts";
import { chipClass, stateText } from "../../src/words/fault-state.ts";
import { sentence } from "../../src/words/sentence.ts";
import { healthByFaults, severity } from "../../src/words/severity.ts";
import { isFailing, STATUS_BITS } from "../../src/words/status-byte.ts";
import { ambiguousCauses, judgedShare, verdict } from "../../src/words/verdict.ts";

test("known codes and kinds have titles, unknown ones are shown as plain text", () => {
  assert.equal(faultTitle("x_servo", "gain"), "X servo, gain");
  assert.equal(faultTitle("x_servo"), "X servo");
  assert.equal(codeTitle("new_code"), "new code");
  assert.equal(kindMeaning("new_kind"), "new kind");
  assert.equal(kindMeaning(null), "the kind of fault is not known");
});

test("severity decreases from confirmed over acknowledged to pending; other faults are not active", () => {
  const order = [
    { status: "confirmed" },
    { status: "confirmed", acknowledged: true },
    { status: "pending" },
    { status: "healed" },
  ];
  assert.deepEqual(order.map(severity), [3, 2, 1, 0]);
  assert.equal(healthByFaults(order), "fault");
  assert.equal(healthByFaults(order.slice(2)), "suspect");
  assert.equal(healthByFaults([]), undefined);
});

test("a fault's chip shows its state", () => {
  const acknowledged = { status: "confirmed", acknowledged: true };
  assert.equal(stateText(acknowledged), "confirmed, acknowledged");
  assert.equal(chipClass(acknowledged), "chip chip-known");
  assert.equal(stateText({ status: "cleared", acknowledged: true }), "cleared");
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
  assert.equal(ambiguousCauses([x, y]), "Cannot tell: X servo, gain (70 %) or Y servo (30 %)");
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
      "No fault of Position sensor; not learnt: X servo",
      "quiet",
    ],
    [
      summary({ x_servo: "not learnt", sensor: "not judged" }),
      "Not learnt: X servo; not judged: Position sensor",
      "quiet",
    ],
    [summary({ ...passed, x_servo: "pending" }), "Pending only: X servo", "status-pending"],
    [summary(passed, ["x_servo", "y_servo"]), "X servo, Y servo", "status-confirmed"],
    [
      summary({ sensor: "not judged" }, ["x_servo"]),
      "X servo; not judged: Position sensor",
      "status-confirmed",
    ],
    [summary({}, [], "not judged"), "Not judged", "quiet"],
  ];
  for (const [of, text, look] of cases) assert.deepEqual(verdict(of), { text, look });
});

test("an ambiguous fault is shown with its candidates", () => {
  const of = summary({ x_servo: "cannot tell" }, ["x_servo"]);
  of.monitors[0].candidates = [
    { code: "x_servo", weight: 0.5 },
    { code: "stuck_ball", weight: 0.5 },
  ];
  assert.equal(verdict(of).text, "Cannot tell: X servo (50 %) or Stuck ball (50 %)");
});

test("a judged share has its duration", () => {
  assert.equal(judgedShare({ judged_share: 0.456, judged_s: 119.6 }), "46 %, 2\u202fmin 0\u202fs");
  assert.equal(judgedShare({}), "0 %, 0.0\u202fs");
});
