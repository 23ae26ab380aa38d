// The marks of remarks.
import assert from "node:assert/strict";
import { test } from "node:test";
import { remarkMarks, remarkTime } from "../../src/pages/session/remarks.ts";

test("a moment has one mark, a stretch one at each end", () => {
  const marks = remarkMarks([
    { text: "new horn", from_s: 3, to_s: 3 },
    { text: "pushed\nby hand", from_s: 5, to_s: 6 },
  ]);
  assert.deepEqual(
    marks.map(({ t, label }) => [t, label]),
    [
      [3, "new horn"],
      [5, "pushed"],
      [6, ""],
    ],
  );
  assert.ok(
    marks.every(({ axis }) => axis === undefined),
    "in the charts of both axes",
  );
});

test("a long text is cut in its mark", () => {
  const [{ label }] = remarkMarks([{ text: "x".repeat(99), from_s: 0, to_s: 0 }]);
  assert.ok(label.length <= 24 && label.endsWith("…"));
});

test("the time of a remark is a moment or a range", () => {
  assert.equal(remarkTime({ from_s: 1, to_s: 1 }), "1.00\u202fs");
  assert.equal(remarkTime({ from_s: 1, to_s: 2 }), "1.00\u202fs to 2.00\u202fs");
});
