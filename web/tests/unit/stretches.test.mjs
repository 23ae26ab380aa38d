// The stretches in which a long recording is shown.
import assert from "node:assert/strict";
import { test } from "node:test";
import { stretches, stretchText } from "../../src/pages/session/stretches.ts";

test("a recording that can be shown whole is not divided", () => {
  assert.deepEqual(stretches({ samples: 6000, first_t_s: 0, last_t_s: 60 }), []);
  assert.deepEqual(stretches({ samples: 0, first_t_s: null, last_t_s: null }), []);
});

test("a long one is divided without a gap, up to its last sample", () => {
  const day = stretches({ samples: 8_640_000, first_t_s: 100, last_t_s: 86_500 });
  assert.equal(day.length, 6);
  assert.deepEqual(day[0], { from_s: 100, to_s: 14_500 });
  assert.equal(day[5].to_s, 86_500);
  day.slice(1).forEach((stretch, i) => assert.equal(stretch.from_s, day[i].to_s));
  assert.equal(stretchText(day[1], 100), "4.00 h to 8.00 h");
});
