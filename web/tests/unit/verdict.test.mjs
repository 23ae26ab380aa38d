// The kinds of faults in the verdict of a session.
import assert from "node:assert/strict";
import { test } from "node:test";
import { verdict } from "../../src/words/verdict.ts";

test("a verdict tells the kind that was confirmed first, and those named later", () => {
  const of = { outcome: "fault", faults: ["x_servo", "sensor"], monitors: [] };
  const line = (code, status, kind, t_s) => ({ code, status, kind, t_s });
  const lines = [
    line("x_servo", "pending", "gain"),
    line("x_servo", "confirmed", null),
    line("x_servo", "confirmed", "dead"),
    line("x_servo", "confirmed", null),
    line("sensor", "pending", "noise"),
  ];
  assert.equal(verdict(of, lines).text, "X servo (dead), Position sensor");
  assert.equal(verdict(of).text, "X servo, Position sensor");
  const revised = [
    line("x_servo", "confirmed", "offset", 9001),
    line("x_servo", "confirmed", "slow", 9602.3),
  ];
  const told = "X servo (offset, later slow at 9602.30\u202fs), Position sensor";
  assert.equal(verdict(of, revised).text, told);
  // A list has the summary only.
  const kinds = [
    { kind: "offset", t_s: 9001, weight: 0.9 },
    { kind: "slow", t_s: 9602.3, weight: 0.9 },
  ];
  const monitors = [{ code: "x_servo", outcome: "fault", candidates: [], kinds }];
  assert.equal(verdict({ ...of, monitors }).text, told);
  const probable = [{ ...monitors[0], kinds: [{ ...kinds[0], weight: 0.51 }] }];
  assert.equal(
    verdict({ ...of, monitors: probable }).text,
    "X servo (probably offset, 51 %), Position sensor",
  );
});

test("a verdict names the servo whose axis has another level, and does not take it for a wrong unit", () => {
  const monitor = (code, outcome) => ({ code, outcome, candidates: [] });
  const monitors = [monitor("x_servo", "no fault"), monitor("y_servo", "cannot tell")];
  const of = { outcome: "cannot tell", faults: [], monitors };
  assert.deepEqual(verdict(of), {
    text: "No fault: X servo; cannot tell: Y servo",
    look: "status-pending",
  });
  const excused = { ...of, faults: ["x_servo"], monitors: [monitor("x_servo", "fault"), monitors[1]] };
  assert.equal(verdict(excused).text, "Cannot tell a wrong unit from X servo; cannot tell: Y servo");
});
