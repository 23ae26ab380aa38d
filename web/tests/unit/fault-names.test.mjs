// The titles of faults, and how sure their kinds are.
import assert from "node:assert/strict";
import { test } from "node:test";
import { alarmTitle } from "../../src/words/alarm.ts";
import { codeTitle, faultMeaning, faultTitle, kindMeaning } from "../../src/words/fault-names.ts";
import { repairNote } from "../../src/words/fault-state.ts";
import { ambiguousCauses, verdict } from "../../src/words/verdict.ts";

test("known codes and kinds have titles, unknown ones are shown as plain text", () => {
  assert.equal(faultTitle({ code: "x_servo", kind: "gain" }), "X servo (gain)");
  assert.equal(faultTitle({ code: "x_servo" }), "X servo");
  assert.equal(codeTitle("new_code"), "new code");
  assert.equal(kindMeaning("new_kind"), "new kind");
  assert.equal(kindMeaning(null), "the kind of fault is not known");
});

test("a banner says what is wrong, also if the kind is not known", () => {
  const dead = { code: "x_servo", kind: "dead" };
  assert.equal(faultMeaning(dead), "does not respond: the plate returns to zero");
  assert.equal(faultMeaning(dead, true), "did not respond: the plate returned to zero");
  assert.equal(faultMeaning({ code: "sensor" }), "the readings are implausible");
});

test("two servos beside a stuck ball are one cause", () => {
  const servo = { code: "x_servo", kind: "dead", weight: 0.25 };
  const ball = { code: "stuck_ball", kind: null, weight: 0.5 };
  const told = (...candidates) => ambiguousCauses(candidates);
  assert.equal(
    told(ball, servo, { ...servo, code: "y_servo" }),
    "Cannot tell: Stuck ball 50 % or Both servos 50 %",
  );
  assert.equal(told(ball, { ...servo, weight: 0.5 }), "Cannot tell: Stuck ball 50 % or X servo (dead) 50 %");
});

test("a kind that is not much likelier than the others is stated as probable, with its weight", () => {
  const candidates = [
    { code: "x_servo", kind: "dead", weight: 0.51 },
    { code: "x_servo", kind: "gain", weight: 0.49 },
  ];
  const fault = { code: "x_servo", kind: "dead", status: "confirmed", candidates };
  assert.equal(faultTitle(fault), "X servo (probably dead, 51 %)");
  assert.equal(faultTitle(fault, true), "X servo (probably dead)", "in a chip");
  assert.equal(faultMeaning(fault), "probably does not respond: the plate returns to zero");
  assert.equal(
    faultTitle({ code: "x_servo", kind: "dead", kind_weight: 0.51 }),
    faultTitle(fault),
    "in lists",
  );
  assert.equal(faultTitle({ code: "x_servo", kind: "dead", kind_weight: 0.8 }), "X servo (dead)");
  assert.equal(faultTitle({ ...fault, candidates: [] }), "X servo (dead)", "the only candidate");
  assert.equal(alarmTitle({ code: "x_servo", kind: "dead", kind_weight: 0.51 }), faultTitle(fault));
  const summary = { outcome: "fault", faults: ["x_servo"], monitors: [] };
  assert.equal(verdict(summary, [fault]).text, "X servo (probably dead, 51 %)");
});

test("an offset whose test passes again is not told as repaired", () => {
  assert.match(repairNote({ kind: "offset" }), /without a repair: check the servo/);
  assert.equal(repairNote({ kind: "dead" }), "");
});
