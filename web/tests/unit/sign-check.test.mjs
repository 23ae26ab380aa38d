// The sign check of a recording.
import assert from "node:assert/strict";
import { test } from "node:test";
import { judgeSign } from "../../src/live/correlation.ts";
import { curvature } from "../../src/pages/import/curvature.ts";
import { checkSigns } from "../../src/pages/import/sign-check.ts";
import { random } from "./random.mjs";

test("the curvature of a parabola is exact, with any offset, slope and gaps", () => {
  const t = Array.from({ length: 21 }, (_, i) => 5 + i * 0.01);
  const parabola = t.map((s) => 3 - 2 * s + 1.5 * s * s);
  assert.ok(Math.abs(curvature(t, parabola, 0, 20) - 3) < 1e-6);
  const gaps = parabola.map((value, i) => (i % 3 ? value : null));
  assert.ok(Math.abs(curvature(t, gaps, 0, 20) - 3) < 1e-6, "without every third reading");
});

test("too few readings, or all at one moment, have no curvature", () => {
  const t = [0, 1, 2, 3, 4, 5, 6];
  assert.equal(curvature(t, [0, 1, null, 3, null, 5, 6], 0, 6), null);
  assert.equal(curvature(Array(7).fill(1), t, 0, 6), null);
});

/** A recording of 60 s of a ball that follows the commanded plate angles after 0.08 s. */
function recording(change = (columns) => columns) {
  const noise = random(9);
  const t_s = Array.from({ length: 6000 }, (_, i) => i * 0.01);
  const qx = (t) => 0.05 * Math.sin(1.3 * t);
  const qy = (t) => 0.05 * Math.sin(2.1 * t);
  // The double integral of a sine is its negative divided by the frequency squared.
  const roll = (amplitude, frequency) => (t) =>
    (-7 * amplitude * Math.sin(frequency * (t - 0.08))) / frequency ** 2 + 0.0002 * (noise() - 0.5);
  return change({
    t_s,
    cmd_qx_rad: t_s.map(qx),
    cmd_qy_rad: t_s.map(qy),
    x_m: t_s.map(roll(0.05, 2.1)),
    y_m: t_s.map(roll(-0.05, 1.3)),
  });
}

const verdicts = (columns) => {
  const { x, y } = checkSigns(columns);
  return [judgeSign(x), judgeSign(y)];
};

test("a ball that follows the tilt agrees", () => {
  assert.deepEqual(verdicts(recording()), ["agrees", "agrees"]);
});

test("reversed and swapped axes are detected", () => {
  const reversed = recording((of) => ({ ...of, x_m: of.x_m.map((x) => -x) }));
  assert.deepEqual(verdicts(reversed), ["reversed", "agrees"]);
  const swapped = recording((of) => ({ ...of, x_m: of.y_m, y_m: of.x_m }));
  assert.deepEqual(verdicts(swapped), ["swapped", "swapped"]);
});

test("a resting ball or a file of a few rows is unclear", () => {
  const atRest = recording((of) => ({ ...of, x_m: of.x_m.map(() => 0), y_m: of.y_m.map(() => 0) }));
  assert.deepEqual(verdicts(atRest), ["unclear", "unclear"]);
  const column = [0, 0.01];
  const short = { t_s: column, cmd_qx_rad: column, cmd_qy_rad: column, x_m: column, y_m: column };
  assert.deepEqual(verdicts(short), ["unclear", "unclear"]);
});
