// The settings that are tried on a session.
import assert from "node:assert/strict";
import { test } from "node:test";
import { query } from "../../src/api/request.ts";
import { alarmMarks, factorAt, isTried, positionOf, trialQuery } from "../../src/pages/session/trial.ts";

test("only what was changed is asked for", () => {
  const settings = { x_servo: { limit: 2 }, sensor: { debounce_s: 0 }, y_servo: {} };
  assert.equal(query(trialQuery(settings)), "?x_servo_limit=2&sensor_debounce_s=0");
  assert.ok(isTried(settings));
  assert.ok(!isTried({ y_servo: {} }));
  assert.ok(!isTried({}));
});

test("the slider has the factor of one in its scale, and three digits", () => {
  assert.equal(factorAt(0), 1);
  assert.equal(factorAt(positionOf(30)), 30);
  assert.equal(factorAt(0.5), 3.16);
});

test("an alarm of a servo is marked along its axis only", () => {
  const found = (code, alarms_t_s) => ({ thresholds: { code }, alarms_t_s });
  const marks = alarmMarks([found("y_servo", [3, 4]), found("sensor", [5])]);
  assert.deepEqual(
    marks.map(({ t, axis }) => [t, axis]),
    [
      [3, "y"],
      [4, "y"],
      [5, null],
    ],
  );
});
