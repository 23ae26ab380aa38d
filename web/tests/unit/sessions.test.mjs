// The logic of the pages of sessions, the demo and drive cycles.
import { decisiveNats, evidenceRows } from "../../src/pages/fault/evidence-rows.ts";
import { firstSeen, playedOn } from "../../src/pages/session/playback-time.ts";
import assert from "node:assert/strict";
import { test } from "node:test";
import { cycleCsv } from "../../src/pages/asset/drive-cycle/cycle-csv.ts";
import { faultList, faultsByCode } from "../../src/pages/learn/demo-faults.ts";
import { exampleSession } from "../../src/pages/learn/example-session.ts";
import { sharesAlongX } from "../../src/pages/learn/shares.ts";
import { replaySettings } from "../../src/pages/session/replay-settings.ts";
import { healthyStretch } from "../../src/pages/learn/healthy-stretch.ts";
import { readAddress, withAddress } from "../../src/pages/session/address.ts";
import { detailWindow, isCovered, longestDetail } from "../../src/pages/session/detail-window.ts";
import { stretchAt } from "../../src/pages/session/stretches.ts";
import { panned, visibleRange, zoomRange } from "../../src/pages/session/visible-range.ts";

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
  assert.equal(faultList(["x_servo:dead", "sensor:noise"]), "X servo (dead), Position sensor (noise)");
  assert.equal(faultList(["sensor:freeze", "y_servo:hold"]), "Position sensor (frozen), Y servo (held)");
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

test("the lesson shows what lies before the first fault, and after one that is repaired", () => {
  const session = { first_t_s: 100, last_t_s: 160 };
  const fails = (t_s, onset_s) => ({ t_s, onset_s, code: "x_servo", status_byte: "2F" });
  const passes = (t_s) => ({ t_s, code: "x_servo", status_byte: "2E" });
  assert.deepEqual(healthyStretch(session, []), { from_s: 100, to_s: 120, fault_s: undefined });
  assert.deepEqual(healthyStretch(session, [fails(111, 110.5)]), {
    from_s: 100,
    to_s: 109.5,
    fault_s: 110.5,
  });
  assert.equal(healthyStretch(session, [fails(103, 102)]), undefined, "too short");
  const after = healthyStretch(session, [passes(102), fails(130, 129)]);
  assert.deepEqual(after, { from_s: 102, to_s: 122, fault_s: 129 });
  const between = healthyStretch(session, [fails(103, 102), passes(110), fails(150, 149)]);
  assert.deepEqual(between, { from_s: 110, to_s: 130, fault_s: 149 });
  const other = { ...fails(104), code: "y_servo" };
  assert.equal(
    healthyStretch(session, [fails(103, 102), other, passes(110)]),
    undefined,
    "another one fails on",
  );
  assert.equal(healthyStretch({ first_t_s: null, last_t_s: null }, []), undefined);
});

test("the moment, speed and profile are in the address; what is unknown there is left out", () => {
  assert.deepEqual(readAddress("?t=12.5&speed=2&profile=textbook"), {
    t: 12.5,
    speed: 2,
    profile: "textbook",
  });
  assert.deepEqual(readAddress("?t=x&speed=3&profile=none"), { t: undefined, speed: 1, profile: "" });
  assert.deepEqual(readAddress(""), { t: undefined, speed: 1, profile: "" });
  assert.equal(withAddress("?t=1.00&speed=2", { t: 3.456, speed: 1 }), "?t=3.46");
  assert.equal(withAddress("", { profile: "default" }), "?profile=default");
  assert.equal(withAddress("?profile=default", { profile: "" }), "");
});

test("a zoom stays within the recording, and is moved by a share of its length", () => {
  assert.deepEqual(zoomRange([30, 20], 0, 90), [20, 30], "dragged to the left");
  assert.deepEqual(zoomRange([-5, 5], 0, 90), [0, 10]);
  assert.deepEqual(panned([20, 30], 0.5, 0, 90), [25, 35]);
  assert.deepEqual(panned([82, 88], 1, 0, 90), [84, 90], "at the end");
  const [from, to] = zoomRange([20, 20], 0, 90);
  assert.ok(to - from >= 0.1 - 1e-9, "not shorter than can be drawn");
});

test("of a long recording, the part around the shown range is fetched, and the next in time", () => {
  const all = [0, 4000];
  assert.equal(longestDetail(20, 12_000), 540);
  const part = detailWindow([1000, 1030], 540, all);
  assert.ok(part[0] <= 1000 && part[1] - part[0] === 150, String(part));
  assert.ok(isCovered([1000, 1030], part, all));
  assert.ok(!isCovered([part[1] - 31, part[1] - 1], part, all), "the playback is about to leave it");
  const last = detailWindow([3990, 4000], 540, all);
  assert.equal(last[1], 4000);
  assert.ok(isCovered([3990, 4000], last, all), "nothing follows the end");
  assert.deepEqual(detailWindow([0, 10], 20, all), [0, 20], "not longer than can be shown in full");
});

test("the stretch of a long recording is that of the moment in the address", () => {
  const pieces = [
    { from_s: 0, to_s: 10 },
    { from_s: 10, to_s: 20 },
  ];
  assert.equal(stretchAt(pieces, 15), 1);
  assert.equal(stretchAt(pieces, 99), undefined);
  assert.equal(stretchAt(pieces), undefined);
});

test("slow frames do not slow the playback down, and a hidden tab does not skip ahead", () => {
  let t = 0;
  for (let frame = 0; frame < 12; frame++) t = playedOn(t, 250, 1, 40);
  assert.equal(t, 3);
  assert.equal(playedOn(0, 250, 2, 40), 0.5);
  assert.equal(playedOn(0, 60_000, 1, 40), 1);
  assert.equal(playedOn(39.9, 1000, 10, 40), 40);
});

test("a playback begins where the ball is first seen, unless that is late", () => {
  const recording = (unseen) => {
    const t = Array.from({ length: 100 }, (_, i) => i / 10);
    const position = t.map((at) => (at < unseen ? null : 0.01));
    const at = (axis, column, t) => position[Math.round(10 * t)];
    return { t, first: 0, last: 9.9, at };
  };
  assert.equal(firstSeen(recording(1.5)), 1.5);
  assert.equal(firstSeen(recording(8)), 0);
});

test("in a freeze frame, what speaks for a fault is marked: the evidence, too", () => {
  const axis = { enabled: true, residual_m_s2: 0.204, limit_m_s2: 0.212, nats: 12.8 };
  const thresholds = [{ code: "x_servo", suspect_nats: 12, confirm_nats: 15.04 }];
  const marked = (x, decided = thresholds) =>
    evidenceRows({ x, y: { limit_m_s2: 0.2 } }, decided)
      .filter(({ cells }) => cells[0].isBeyondLimit)
      .map(({ name }) => name);
  assert.deepEqual(marked(axis), ["Weight of evidence for a servo fault"]);
  assert.deepEqual(marked({ ...axis, nats: 3, residual_m_s2: -0.3 }), ["Residual"]);
  assert.deepEqual(marked({ ...axis, nats: 3, residual_m_s2: -0.3, enabled: false }), []);
  // Whatever the evidence is, only the values that applied decide.
  assert.deepEqual(marked({ ...axis, nats: 11.9 }), []);
  assert.deepEqual(marked(axis, [{ code: "x_servo", suspect_nats: null, confirm_nats: null }]), []);
  assert.deepEqual(marked(axis, []), []);
  assert.match(decisiveNats(thresholds), /of 12\snats and more \(confirmed from 15\) is red/);
  const y = { code: "y_servo", suspect_nats: 10, confirm_nats: 13 };
  assert.match(decisiveNats([...thresholds, y]), /along x and 10\snats.* along y/);
  assert.match(decisiveNats([{ ...y, suspect_nats: null }]), /did not decide/);
  assert.match(decisiveNats(undefined), /not known/);
});
