// The numbers along the axes of charts.
import assert from "node:assert/strict";
import { test } from "node:test";
import { extentOf, valueLabels, valueRange, valueStep } from "../../src/parts/charts/axis-labels.ts";

test("neighbouring labels differ, and zero has no sign", () => {
  assert.deepEqual(valueLabels([-0.02, -0.0, 0.02], 0.02, 1), ["−0.02", "0.00", "0.02"]);
  assert.deepEqual(valueLabels([-0.25, 0, 0.25], 0.25, 1), ["−0.25", "0.00", "0.25"]);
  assert.deepEqual(valueLabels([-100, 0, 100], 100, 0), ["−100", "0", "100"]);
  assert.deepEqual(valueLabels([0, 0.5, null], 0.5, 1), ["0.0", "0.5", ""]);
  for (const step of [1e-5, 2e-4, 0.001, 0.05, 2.5, 20]) {
    const labels = valueLabels(
      Array.from({ length: 9 }, (_, i) => (i - 4) * step),
      step,
      1,
    );
    assert.equal(new Set(labels).size, labels.length, labels.join(" "));
  }
});

test("the range has the values and zero, and a default without any", () => {
  assert.deepEqual(valueRange(2, 10, 0, false), [-0.8, 10.8]);
  assert.deepEqual(valueRange(null, null, 0, false), [-1, 1]);
  assert.deepEqual(valueRange(Infinity, -Infinity, 100, false), [-116, 116]);
  assert.equal(valueRange(-5, 10, 0, true)[0], -0.8);
});

test("charts of one scale know the extent of all their lines", () => {
  assert.deepEqual(
    extentOf([
      [1, null, 3],
      [-2, undefined, 0],
    ]),
    [-2, 3],
  );
  assert.equal(extentOf([[null], []]), undefined);
});

test("a low chart has four to seven numbers along its axis, whatever its values", () => {
  for (let extent = 1e-4; extent < 1e4; extent *= 1.03) {
    for (const minimum of [-extent, -extent / 7, 0]) {
      const [low, high] = valueRange(minimum, extent, 0, minimum === 0);
      for (const px of [92, 114]) {
        const step = valueStep(low, high, px);
        const n = Math.floor(high / step) - Math.ceil(low / step) + 1;
        assert.ok(n >= 4 && n <= 7, `${n} from ${low} to ${high}`);
      }
    }
  }
  assert.equal(valueStep(-0.116, 0.116, 114), 0.05);
  assert.equal(valueStep(-0.116, 0.116, 1000), 0.05, "no more of them in a tall chart");
});
