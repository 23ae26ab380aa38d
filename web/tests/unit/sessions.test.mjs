// The logic of the pages of sessions, the demo and drive cycles.
import assert from "node:assert/strict";
import { test } from "node:test";
import { cycleCsv } from "../../src/pages/asset/drive-cycle/cycle-csv.ts";
import { faultList, faultsByCode } from "../../src/pages/learn/demo-faults.ts";
import { exampleSession } from "../../src/pages/learn/example-session.ts";
import { sharesAlongX } from "../../src/pages/learn/shares.ts";
import { replaySettings } from "../../src/pages/session/replay-settings.ts";
import { visibleRange } from "../../src/pages/session/visible-range.ts";

test("the charts show the span around the moment, within the recording", () => {
  assert.deepEqual(visibleRange(50, 30, 0, 90), [32, 62]);
  assert.deepEqual(visibleRange(2, 30, 0, 90), [0, 30]);
  assert.deepEqual(visibleRange(90, 30, 0, 90), [72, 90]);
  assert.deepEqual(visibleRange(50, 0, 5, 90), [5, 90]);
  assert.deepEqual(visibleRange(0.1, 10, 0, 0.2), [0, 1], "a short recording");
});

test("a replay requests only the settings of the form", () => {
  const empty = { profile: "", debounce: "", isUnlearnt: false };
  assert.deepEqual(replaySettings(empty), {});
  assert.deepEqual(replaySettings({ ...empty, profile: "textbook" }), { profile: "textbook" });
  assert.deepEqual(replaySettings({ ...empty, debounce: "0.5", isUnlearnt: true }), {
    asset: { diagnostics: { debounce_s: 0.5 }, calibration: null },
  });
});

test("the demo's faults are grouped by code and named in words", () => {
  const groups = faultsByCode(["x_servo:dead", "sensor:noise", "x_servo:slow"]);
  assert.deepEqual([...groups.keys()], ["x_servo", "sensor"]);
  assert.deepEqual(
    groups.get("x_servo").map(({ effect }) => effect),
    ["dead", "slow"],
  );
  assert.equal(faultList(["x_servo:dead", "sensor:noise"]), "x servo, dead; sensor, noise");
});

test("the example is the chosen session, otherwise the preferred one without a fault", () => {
  const session = (id, asset, faults, state = "ended") => ({
    id,
    asset,
    state,
    verdict: faults && { faults },
  });
  const open = session("1", "bench", undefined, "open");
  const sick = session("2", "bench", ["sensor"]);
  const whole = session("3", "bench", []);
  const demo = session("4", "demo-rig", []);
  const chosen = (sessions, id = "") => exampleSession(sessions, id)?.id;
  assert.equal(chosen([open, sick, whole, demo], "2"), "2");
  assert.equal(chosen([open, sick, whole, demo]), "4");
  assert.equal(chosen([open, sick, whole]), "3");
  assert.equal(chosen([open, sick]), "2");
  assert.equal(chosen([open]), "1");
  assert.equal(chosen([]), undefined);
});

test("shares count the moments beyond the limit, among all and among the judged ones", () => {
  const x = {
    measured_m_s2: [0, 1, 1, null, 0],
    twin_m_s2: [0, 0, 0, 0, 0],
    limit_m_s2: [0.5, 0.5, 0.5, 0.5, 0.5],
    enabled: [true, true, false, true, false],
  };
  assert.deepEqual(sharesAlongX({ x }), { beyond: 0.5, judged: 0.5, beyondOfJudged: 0.5 });
  const none = { measured_m_s2: [], twin_m_s2: [], limit_m_s2: [], enabled: [] };
  assert.deepEqual(sharesAlongX({ x: none }), { beyond: null, judged: null, beyondOfJudged: null });
});

test("a drive cycle's CSV has a line for each moment, empty where there is no set point", () => {
  const rows = { t_s: [0, 0.01], cmd_qx_rad: [1, 2], cmd_qy_rad: [3, 4], x_m: [5, null], y_m: [null, 6] };
  assert.equal(cycleCsv({ rows }), "t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m\n0,1,3,5,\n0.01,2,4,,6\n");
});
