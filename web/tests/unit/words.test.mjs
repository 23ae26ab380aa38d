// What codes, statuses and verdicts are called.
import assert from "node:assert/strict";
import { test } from "node:test";
import { codeTitle, faultTitle, kindMeaning } from "../../src/words/fault-names.ts";
import { chipClass, standingText } from "../../src/words/fault-standing.ts";
import { sentence } from "../../src/words/sentence.ts";
import { healthByFaults, severity } from "../../src/words/severity.ts";
import { isFailing, STATUS_BITS } from "../../src/words/status-byte.ts";
import { ambiguousCauses, judgedShare, verdict } from "../../src/words/verdict.ts";

test("known codes and kinds have words, unknown ones are shown as they are", () => {
  assert.equal(faultTitle("x_servo", "gain"), "X servo, gain");
  assert.equal(faultTitle("x_servo"), "X servo");
  assert.equal(codeTitle("new_code"), "new code");
  assert.equal(kindMeaning("new_kind"), "new kind");
  assert.equal(kindMeaning(null), "the evidence does not say in which way");
});

test("confirmed is worse than acknowledged, that worse than pending, the rest is not active", () => {
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

test("a fault's chip says how it stands", () => {
  const acknowledged = { status: "confirmed", acknowledged: true };
  assert.equal(standingText(acknowledged), "confirmed, acknowledged");
  assert.equal(chipClass(acknowledged), "chip chip-known");
  assert.equal(standingText({ status: "cleared", acknowledged: true }), "cleared");
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

test("causes in different parts of the rig are named with their weights", () => {
  const x = { code: "x_servo", kind: "gain", weight: 0.7 };
  const y = { code: "y_servo", weight: 0.3 };
  assert.equal(ambiguousCauses([x, y]), "Cannot tell: X servo, gain (70 %) or Y servo (30 %)");
  assert.equal(ambiguousCauses([x, { ...x, kind: "offset" }]), "", "the same part in two ways");
  assert.equal(ambiguousCauses([]), "");
});

/** A summary with monitors of these outcomes. */
const summary = (outcomes, faults = [], outcome = "judged") => ({
  outcome,
  faults,
  monitors: Object.entries(outcomes).map(([code, outcome]) => ({ code, outcome, candidates: [] })),
});

test("a verdict says what was found, and what was not judged", () => {
  const sound = { x_servo: "no fault", sensor: "no fault" };
  const cases = [
    [summary(sound), "No fault", "status-ok"],
    [
      summary({ ...sound, x_servo: "not learnt" }),
      "No fault of Position sensor; not learnt: X servo",
      "quiet",
    ],
    [
      summary({ x_servo: "not learnt", sensor: "not judged" }),
      "Not learnt: X servo; not judged: Position sensor",
      "quiet",
    ],
    [summary({ ...sound, x_servo: "pending" }), "Pending only: X servo", "status-pending"],
    [summary(sound, ["x_servo", "y_servo"]), "X servo, Y servo", "status-confirmed"],
    [
      summary({ sensor: "not judged" }, ["x_servo"]),
      "X servo; not judged: Position sensor",
      "status-confirmed",
    ],
    [summary({}, [], "not judged"), "Not judged", "quiet"],
  ];
  for (const [of, text, look] of cases) assert.deepEqual(verdict(of), { text, look });
});

test("a fault whose monitor could not tell is shown with its causes", () => {
  const of = summary({ x_servo: "cannot tell" }, ["x_servo"]);
  of.monitors[0].candidates = [
    { code: "x_servo", weight: 0.5 },
    { code: "stuck_ball", weight: 0.5 },
  ];
  assert.equal(verdict(of).text, "Cannot tell: X servo (50 %) or Stuck ball (50 %)");
});

test("a judged share has its length in time", () => {
  assert.equal(judgedShare({ judged_share: 0.456, judged_s: 119.6 }), "46 %, 2\u202fmin 0\u202fs");
  assert.equal(judgedShare({}), "0 %, 0.0\u202fs");
});
