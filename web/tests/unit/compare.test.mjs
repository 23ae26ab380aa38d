// Two sessions on one time axis.
import assert from "node:assert/strict";
import { test } from "node:test";
import {
  alignedMarks,
  alignedTrace,
  commonRange,
  difference,
  readCompare,
  valuesAt,
} from "../../src/pages/compare/align.ts";
import { withToggled } from "../../src/pages/sessions/with-toggled.ts";
import { comparePath } from "../../src/router/paths.ts";

test("recordings of any clock begin at the same moment, and the second may be moved", () => {
  const [a, b] = [{ t_s: [100, 101, 103] }, { t_s: [7, 9] }];
  assert.deepEqual(alignedTrace(a, 0).t_s, [0, 1, 3]);
  assert.deepEqual(alignedTrace(b, -2).t_s, [-2, 0]);
  assert.deepEqual(commonRange(alignedTrace(a, 0), alignedTrace(b, -2)), [-2, 3]);
  assert.equal(commonRange({ t_s: [] }, { t_s: [] }), undefined);
  assert.deepEqual(a.t_s, [100, 101, 103], "the trace itself is not changed");
});

test("a fault is marked where it is on the common axis", () => {
  const line = { t_s: 8, code: "x_servo", axis: "x", status: "confirmed", status_byte: "2F" };
  assert.equal(alignedMarks([line], 7, 0.5)[0].t, 1.5);
});

test("the address has both sessions and the shift", () => {
  const read = (address) => readCompare(new URL(address, "http://host").searchParams);
  assert.deepEqual(read(comparePath("1", "x&y", 1.5)), { a: "1", b: "x&y", shift: 1.5 });
  assert.deepEqual(read(comparePath("1", "2")), { a: "1", b: "2", shift: 0 });
  assert.deepEqual(read("/compare?shift=odd"), { a: undefined, b: undefined, shift: 0 });
});

test("at most two sessions are chosen", () => {
  const chosen = ["1", "2", "3"].reduce(withToggled, []);
  assert.deepEqual(chosen, ["2", "3"]);
  assert.deepEqual(withToggled(chosen, "2"), ["3"]);
});

test("of two curves in one chart, each has its latest value at a moment", () => {
  const data = [
    [0, 1, 2, 3],
    [5, undefined, 7, undefined],
    [undefined, 2, undefined, null],
  ];
  assert.deepEqual(valuesAt(data, 2.5), [7, 2]);
  assert.deepEqual(valuesAt(data, 3), [7, null]);
  assert.deepEqual(valuesAt(data, 0), [5, undefined]);
});

test("the difference of two curves is known where both are", () => {
  const first = [
    [0, 1, 2, 3, 9],
    [1, 2, null, 4, 5],
  ];
  const second = [
    [0.5, 1.5, 2.5, 3.5, 8.5, 9.5],
    [10, 20, 30, null, 80, 90],
  ];
  assert.deepEqual(difference(first, second), [first[0], [null, -13, null, null, -80]]);
  assert.deepEqual(difference(first, first)[1], [0, 0, null, 0, 0]);
  assert.deepEqual(difference(first, [[], []])[1], [null, null, null, null, null]);
});
