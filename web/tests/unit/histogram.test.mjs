// The histogram of the residual.
import assert from "node:assert/strict";
import { test } from "node:test";
import { TraceBuffer } from "../../src/live/buffer.ts";
import { residualHistogram } from "../../src/pages/session/histogram.ts";

/** A buffer with one moment a second, of which `residual` and `enabled` are given. */
function buffer(residual, enabled, limit = 0.5) {
  const made = new TraceBuffer();
  made.t = residual.map((_, i) => i);
  Object.assign(made.x, { residual, enabled, limit: residual.map(() => limit) });
  return made;
}

test("every judged moment of the range is in one bin, symmetric about zero", () => {
  const found = residualHistogram(
    buffer([-1, 0, 0.01, 1, 0.4, 9], [1, 1, 1, 1, 1, 1].map(Boolean)),
    "x",
    [0, 4],
  );
  assert.equal(found.extent, 1);
  assert.equal(found.n, 5);
  assert.equal(
    found.counts.reduce((a, b) => a + b),
    5,
  );
  const middle = (found.counts.length - 1) / 2;
  assert.equal(found.counts[middle], 2, "0 and 0.01 are about zero");
  assert.equal(found.counts[0], 1);
  assert.equal(found.counts.at(-1), 1);
});

test("a moment at its limit is beyond it, and the limit is always within the plot", () => {
  const found = residualHistogram(buffer([0.5, -0.5, 0.49], [true, true, true]), "x", [0, 9]);
  assert.equal(found.nBeyond, 2);
  assert.ok(found.extent > found.limit);
});

test("moments that were not judged, or have no residual, do not count", () => {
  assert.equal(residualHistogram(buffer([1, null], [false, true]), "x", [0, 9]), undefined);
  assert.equal(residualHistogram(buffer([], []), "x", [0, 9]), undefined);
});
