// Signs and axes of a rig, from measured and twin accelerations.
import assert from "node:assert/strict";
import { test } from "node:test";
import { TraceBuffer } from "../../src/live/buffer.ts";
import { correlation, judgeSign } from "../../src/live/correlation.ts";
import { compareSigns, correctedAxes, DEFAULT_AXES } from "../../src/live/signs.ts";
import { servoArrows } from "../../src/parts/xy-trace/servo-arrows.ts";
import { random } from "./random.mjs";

const N = 1000;

/** A trace of 10 s in which the twin's accelerations are two unlike waves. */
function trace({ x, y }) {
  const t_s = Array.from({ length: N }, (_, i) => i * 0.01);
  const twin = { x: t_s.map((t) => Math.sin(2 * t)), y: t_s.map((t) => Math.sin(3.7 * t)) };
  const noise = random(3);
  const columns = (measured, twin) => ({
    measured_m_s2: measured.map((value) => value + 0.1 * (noise() - 0.5)),
    twin_m_s2: twin,
    command_rad: [],
    plate_angle_rad: [],
    position_m: [],
    twin_position_m: [],
    limit_m_s2: [],
    counter: [],
    nats: [],
    enabled: [],
  });
  const counters = { stuck_ball_counter: [], sensor_counter: [] };
  return { t_s, x: columns(x(twin), twin.x), y: columns(y(twin), twin.y), ...counters };
}

const times = (factor, column) => column.map((value) => factor * value);

const compared = (rig) => compareSigns(TraceBuffer.of(trace(rig)));

test("correlation is 1 with itself, −1 with its opposite, and NaN for few or constant values", () => {
  const a = [1, 2, 3, 5, 8, 13];
  assert.ok(Math.abs(correlation(a, a) - 1) < 1e-12);
  assert.ok(Math.abs(correlation(a, times(-2, a)) + 1) < 1e-12);
  assert.ok(Number.isNaN(correlation(a.slice(0, 4), a.slice(0, 4))));
  assert.ok(Number.isNaN(correlation(a, times(0, a))));
});

test("the stronger correlation decides the sign, if it is strong enough", () => {
  assert.equal(judgeSign({ own: 0.8, other: 0.1 }), "agrees");
  assert.equal(judgeSign({ own: -0.8, other: 0.1 }), "reversed");
  assert.equal(judgeSign({ own: 0.1, other: -0.8 }), "swapped");
  assert.equal(judgeSign({ own: 0.2, other: 0.2 }), "unclear");
  assert.equal(judgeSign({ own: NaN, other: 0.9 }), "unclear");
});

test("a rig that agrees with the twin keeps its axes", () => {
  const signs = compared({ x: ({ x }) => x, y: ({ y }) => y });
  assert.deepEqual(signs.verdict, { x: "agrees", y: "agrees" });
  assert.ok(signs.seconds > 8 && signs.seconds <= 10, `${signs.seconds} s`);
  assert.deepEqual(correctedAxes(DEFAULT_AXES, signs), DEFAULT_AXES);
});

test("a reversed axis is corrected with its offset", () => {
  const signs = compared({ x: ({ x }) => times(-1, x), y: ({ y }) => y });
  assert.deepEqual(signs.verdict, { x: "reversed", y: "agrees" });
  const axes = { ...DEFAULT_AXES, x_offset_m: 0.01, y_offset_m: 0.02 };
  assert.deepEqual(correctedAxes(axes, signs), { ...axes, x_sign: -1, x_offset_m: -0.01 });
});

test("without motion the signs are unclear", () => {
  const still = compared({ x: ({ x }) => times(0, x), y: ({ y }) => times(0, y) });
  assert.equal(compareSigns(new TraceBuffer()).seconds, 0);
  assert.deepEqual(still.verdict, { x: "unclear", y: "unclear" });
});

/** All combinations of swapped axes and signs. */
const WIRINGS = [false, true].flatMap((swap) =>
  [1, -1].flatMap((x_sign) => [1, -1].map((y_sign) => ({ swap, x_sign, y_sign }))),
);

test("the corrected axes make any wrong wiring agree", () => {
  for (const { swap, x_sign, y_sign } of WIRINGS) {
    // The device's own x is the rig's x, or its y, times a sign; the service undoes what the axes say.
    const device = ({ x, y }) => ({ x: times(x_sign, swap ? y : x), y: times(y_sign, swap ? x : y) });
    const seenWith = (axes) => (twin) => {
      const sent = device(twin);
      return {
        x: times(axes.x_sign, axes.swap ? sent.y : sent.x),
        y: times(axes.y_sign, axes.swap ? sent.x : sent.y),
      };
    };
    const signsWith = (axes) =>
      compared({ x: (twin) => seenWith(axes)(twin).x, y: (twin) => seenWith(axes)(twin).y });
    const corrected = correctedAxes(DEFAULT_AXES, signsWith(DEFAULT_AXES));
    assert.deepEqual(
      signsWith(corrected).verdict,
      { x: "agrees", y: "agrees" },
      JSON.stringify({ swap, x_sign, y_sign, corrected }),
    );
  }
});

test("the arrows of the servos point where gravity pulls the ball with a positive command", () => {
  const toCanvas = (x, y) => [200 + 1000 * x, 100 - 1000 * y];
  const [x, y] = servoArrows({ length: 0.38, width: 0.24, isRound: false }, toCanvas);
  // Gravity in the plate frame: g·(cos qx sin qy, −sin qx); the y of the canvas points down.
  const pulled = (qx, qy) => [Math.sign(Math.cos(qx) * Math.sin(qy)), Math.sign(Math.sin(qx))];
  const direction = ({ from, to }) => [Math.sign(to[0] - from[0]), Math.sign(to[1] - from[1])];
  assert.match(x.label, /^X servo.*qy/);
  assert.deepEqual(direction(x), pulled(0, 0.1));
  assert.match(y.label, /^Y servo.*qx/);
  assert.deepEqual(direction(y), pulled(0.1, 0));
});
