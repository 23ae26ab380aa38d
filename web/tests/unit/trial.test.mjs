// The settings that are tried on a session.
import assert from "node:assert/strict";
import { test } from "node:test";
import { query } from "../../src/api/request.ts";
import { judgedMarks } from "../../src/pages/session/judged-marks.ts";
import { replaySettings } from "../../src/pages/session/replay-settings.ts";
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
  const marks = alarmMarks([found("y_servo", [3, 4]), found("sensor", [5])], "tried");
  assert.deepEqual(
    marks.map(({ t, axis }) => [t, axis]),
    [
      [3, "y"],
      [4, "y"],
      [5, null],
    ],
  );
});

test("the marks are those of the profile by which the charts are judged", () => {
  const faults = [{ code: "x_servo", t_s: 20.9, status: "confirmed", status_byte: "2F", axis: "x" }];
  const trial = { monitors: [{ thresholds: { code: "x_servo" }, alarms_t_s: [4.9] }] };
  const marks = (settings) =>
    judgedMarks({ faults, profile: "", tried: {}, trial, ...settings }).map(({ t, label }) => [t, label]);
  assert.deepEqual(marks({}), [[20.9, "X servo confirmed"]]);
  assert.deepEqual(marks({ profile: "textbook" }), [[4.9, "X servo, textbook"]]);
  assert.deepEqual(marks({ profile: "textbook", trial: undefined }), [], "not those of the record");
  const tried = { x_servo: { limit: 2 } };
  assert.deepEqual(marks({ tried }), [
    [20.9, "X servo confirmed"],
    [4.9, "X servo, tried"],
  ]);
});

test("a session is judged again with the description and calibration that its rig has now", () => {
  const form = { profile: "", debounce: "", isUnlearnt: false, isPresent: false };
  const rig = {
    sample_rate_hz: 50,
    plate: { diameter_m: 0.3 },
    ball: { radius_m: 0.02 },
    calibration: { id: "c" },
  };
  assert.deepEqual(replaySettings(form, rig), {});
  const asset = {
    sample_rate_hz: 50,
    plate: { length_m: null, width_m: null, diameter_m: 0.3 },
    ball: { radius_m: 0.02 },
    servo: null,
    axes: null,
  };
  assert.deepEqual(replaySettings({ ...form, isPresent: true }, rig), {
    asset: { ...asset, calibration: { id: "c" } },
  });
  const unlearnt = { asset: { ...asset, calibration: null } };
  assert.deepEqual(replaySettings({ ...form, isPresent: true, isUnlearnt: true }, rig), unlearnt);
  assert.deepEqual(
    replaySettings({ ...form, isPresent: true }, { ...rig, calibration: undefined }),
    unlearnt,
  );
});
