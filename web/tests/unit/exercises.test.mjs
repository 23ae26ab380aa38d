// The exercises of the page for learning.
import assert from "node:assert/strict";
import { test } from "node:test";
import { EXERCISES, sessionFor } from "../../src/pages/learn/exercises.ts";

const session = (id, state, faults, samples = 100) => ({ id, state, samples, verdict: faults && { faults } });

test("each exercise has the newest ended session that suits it", () => {
  const sessions = [
    session("open", "open", undefined),
    session("empty", "ended", [], 0),
    session("sick", "ended", ["x_servo"]),
    session("other", "ended", ["sensor"]),
    session("well", "ended", []),
    session("older", "ended", []),
  ];
  const found = EXERCISES.map((exercise) => sessionFor(exercise, sessions)?.id);
  assert.deepEqual(found, ["well", "sick", "sick"]);
  assert.deepEqual(
    EXERCISES.map((exercise) => sessionFor(exercise, [])),
    [undefined, undefined, undefined],
  );
});

test("every exercise says what to do and what to see, shortly", () => {
  for (const { steps, seen, commands } of EXERCISES) {
    assert.ok(steps.length >= 2 && steps.length <= 4 && commands.length);
    assert.ok(seen.length > 50 && seen.length < 300, seen);
  }
});
