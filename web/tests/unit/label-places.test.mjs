// The labels of charts cover neither each other nor the axis.
import assert from "node:assert/strict";
import { test } from "node:test";
import { placeLineLabels, placeMarkLabels } from "../../src/parts/charts/label-places.ts";
import { random } from "./random.mjs";

const HEIGHT = 13;
const BOX = { top: 10, bottom: 120, right: 500 };

test("labels of marks at one time are below each other, and the same text is written once", () => {
  const texts = ["pending", "confirmed", "confirmed", "passes again"];
  const places = placeMarkLabels(
    texts.map((text, i) => ({ x: 100 + i, width: 80, text })),
    500,
    8,
  );
  assert.deepEqual(
    places.map((place) => place?.row),
    [0, 1, undefined, 2],
  );
});

test("labels of marks never overlap, and end before the chart does", () => {
  const next = random(7);
  for (let n = 0; n < 300; n++) {
    const labels = Array.from({ length: 1 + Math.floor(next() * 12) }, (_, i) => ({
      x: Math.floor(next() * 500),
      width: 20 + Math.floor(next() * 120),
      text: `${i}`,
    }));
    const places = placeMarkLabels(labels, 500, 6);
    places.forEach((place, i) => {
      if (!place) return;
      const right = place.left + labels[i].width;
      assert.ok(right <= 500 && place.row < 6, `${place.left}, ${place.row}`);
      places.slice(0, i).forEach((other, k) => {
        if (other?.row !== place.row) return;
        assert.ok(other.left + labels[k].width <= place.left || right <= other.left, `${k} and ${i}`);
      });
    });
  }
});

test("labels of lines that are close to each other never overlap, and are within the chart", () => {
  for (let upper = 10; upper <= 118; upper++)
    for (let lower = upper; lower <= 120; lower++)
      for (const ys of [
        [lower, upper],
        [upper, lower],
      ]) {
        const labels = ys.map((y, i) => ({ y, width: 50 + 10 * i }));
        const [a, b] = placeLineLabels(labels, BOX, HEIGHT);
        const apart = Math.abs(a.top - b.top) >= HEIGHT || a.right <= b.right - 60 || b.right <= a.right - 50;
        assert.ok(apart, `${ys}`);
        for (const { top, right } of [a, b]) {
          assert.ok(top >= BOX.top && top + HEIGHT <= BOX.bottom + 1, `${ys}: ${top}`);
          assert.ok(right <= BOX.right);
        }
      }
});
