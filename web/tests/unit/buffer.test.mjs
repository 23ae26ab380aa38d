// The trace buffer, and the clock of the live view.
import assert from "node:assert/strict";
import { test } from "node:test";
import { TraceBuffer } from "../../src/live/buffer.ts";
import { PlayoutClock } from "../../src/live/playout-clock.ts";
import { poseAt } from "../../src/live/pose.ts";
import { traceOfRecording } from "../../src/live/recording.ts";
import { random } from "./random.mjs";

/** A trace from `from` on, 10 ms a moment, in which every column is the time or missing. */
function trace(from, n, seen = () => true) {
  const t_s = Array.from({ length: n }, (_, i) => Number((from + i * 0.01).toFixed(2)));
  const known = t_s.map((t, i) => (seen(i) ? t : null));
  const axis = {
    command_rad: t_s,
    plate_angle_rad: t_s,
    position_m: known,
    twin_position_m: t_s,
    measured_m_s2: known,
    twin_m_s2: t_s.map((t) => t - 1),
    limit_m_s2: t_s.map(() => 0.5),
    enabled: t_s.map(() => true),
    counter: t_s.map(() => -128),
    nats: t_s.map(() => 0),
  };
  const counters = t_s.map(() => -128);
  return { t_s, x: axis, y: axis, stuck_ball_counter: counters, sensor_counter: counters };
}

test("moments are appended, with residual and limits on both sides", () => {
  const buffer = TraceBuffer.of(trace(1, 3));
  assert.deepEqual([buffer.first, buffer.last], [1, 1.02]);
  assert.deepEqual(buffer.x.residual, [1, 1, 1]);
  assert.deepEqual([buffer.x.limit[0], buffer.x.limitBelow[0]], [0.5, -0.5]);
});

test("without a position there is no residual, and the twin is not shown", () => {
  const buffer = TraceBuffer.of(trace(0, 3, (i) => i !== 1));
  assert.equal(buffer.x.residual[1], null);
  assert.equal(buffer.x.twinPosition[1], null);
  assert.equal(buffer.x.twinPosition[2], 0.02);
});

test("a full buffer keeps the newest moments in all columns", () => {
  const buffer = new TraceBuffer(100);
  for (let i = 0; i < 37; i++) buffer.append(trace(i * 0.13, 13));
  assert.ok(buffer.t.length >= 100 && buffer.t.length <= 110, `${buffer.t.length} moments`);
  assert.equal(buffer.last, 36 * 0.13 + 0.12);
  for (const column of Object.values(buffer.y)) assert.equal(column.length, buffer.t.length);
  assert.deepEqual(buffer.y.command, buffer.t);
  buffer.clear();
  assert.deepEqual([buffer.t, buffer.x.command, buffer.first, buffer.last], [[], [], 0, 0]);
});

test("over a new connection no moment is there twice, and nothing is drawn across a hole", () => {
  const buffer = new TraceBuffer();
  buffer.append(trace(0, 10));
  buffer.resume(trace(0.05, 10));
  assert.deepEqual(buffer.t, trace(0, 15).t_s);
  for (const columns of [buffer.x, buffer.y, buffer.shared])
    for (const column of Object.values(columns)) assert.equal(column.length, 15);
  assert.deepEqual(buffer.x.command, buffer.t);
  buffer.append(trace(0.1, 2));
  assert.equal(buffer.t.length, 15);
  buffer.resume(trace(5, 3));
  assert.deepEqual(buffer.x.command, [5, 5.01, 5.02]);
});

test("the index of a moment is that of the last one not after it", () => {
  const next = random(11);
  const buffer = TraceBuffer.of(trace(0, 500));
  for (let i = 0; i < 300; i++) {
    const t = next() * 6 - 0.5;
    const wanted = Math.max(buffer.t.filter((each) => each <= t).length - 1, 0);
    assert.equal(buffer.index(t), wanted, `${t}`);
  }
  assert.equal(new TraceBuffer().index(1), 0);
});

test("values are interpolated between moments, but not beyond the last one or next to gaps", () => {
  const buffer = TraceBuffer.of(trace(0, 3, (i) => i !== 2));
  assert.ok(Math.abs(buffer.at("x", "command", 0.005) - 0.005) < 1e-12);
  assert.equal(buffer.at("x", "command", 99), 0.02);
  assert.equal(buffer.at("x", "position", 0.015), 0.01);
  assert.equal(buffer.at("x", "position", 0.02), null);
});

test("the plate's angle about y is that of the x axis, and vice versa", () => {
  const both = trace(0, 2);
  const buffer = TraceBuffer.of({
    ...both,
    y: { ...both.y, plate_angle_rad: [5, 5], position_m: [null, null] },
  });
  assert.deepEqual(poseAt(buffer, 0), { qx: 5, qy: 0, ball: null, ghost: null });
});

test("of a recording, judged rows are drawn, and others only in gaps", () => {
  const t_s = Array.from({ length: 100 }, (_, i) => Number((i * 0.01).toFixed(2)));
  const column = (of) => t_s.map(of);
  const limit = column((t, i) => (i >= 50 && i % 2 === 0 ? 0.5 : null));
  const names = ["cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m", "x_measured_m_s2", "x_twin_m_s2"];
  names.push("y_measured_m_s2", "y_twin_m_s2", "x_enabled", "y_enabled");
  const others = Object.fromEntries(names.map((name) => [name, column((t) => t)]));
  const drawn = traceOfRecording({ columns: { t_s, ...others, x_limit_m_s2: limit, y_limit_m_s2: limit } });
  assert.deepEqual(drawn.t_s.slice(0, 5), [0, 0.2, 0.4, 0.5, 0.52]);
  assert.equal(drawn.t_s.length, 3 + 25);
  assert.deepEqual(drawn.x.command_rad, drawn.t_s);
  assert.ok(drawn.x.twin_position_m.every((value) => value === null));
});

test("the clock follows batches evenly with a delay, and jumps after a large deviation", () => {
  const clock = new PlayoutClock(0.25);
  let shown = clock.tick(0, 10);
  assert.equal(shown, 9.75);
  // A batch of 100 ms every 100 ms, seen in frames of 16 ms.
  for (let now = 16; now < 3000; now += 16) {
    const newest = 10 + Math.floor(now / 100) / 10;
    const next = clock.tick(now, newest);
    assert.ok(next > shown && next <= newest, `${next} after ${shown}`);
    assert.ok(next - shown < 0.016 * 1.5 + 1e-9, "at most 1.5 times as fast");
    shown = next;
  }
  assert.equal(clock.tick(3016, 100), 99.75);
});

test("a clock that is behind runs at most 1.5 times as fast, one that is ahead slows down", () => {
  const clock = new PlayoutClock(0.25);
  clock.tick(0, 10);
  // 1.5 s have come at once: the clock stands at 9.75 s and should be at 11.25 s.
  assert.ok(Math.abs(clock.tick(100, 11.5) - 9.9) < 1e-9);
  const ahead = new PlayoutClock(0.25);
  ahead.tick(0, 10);
  // Nothing has come for a second: the clock goes on, but never past what there is.
  for (let now = 100; now <= 1000; now += 100) assert.ok(ahead.tick(now, 10) <= 10);
});
