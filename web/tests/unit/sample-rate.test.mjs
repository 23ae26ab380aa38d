import assert from "node:assert/strict";
import { test } from "node:test";
import { SampleRate } from "../../src/live/sample-rate";

const fed = (counts) => {
  const rate = new SampleRate();
  for (const [t_s, judged] of counts) rate.take({ t_s, judged });
  return rate.hz;
};

test("the rate is that of the last ten seconds", () => {
  const slow = Array.from({ length: 20 }, (_, i) => [i, 10 * i]);
  const fast = Array.from({ length: 20 }, (_, i) => [20 + i, 200 + 100 * i]);
  assert.equal(fed(slow), 10);
  assert.equal(fed([...slow, ...fast]), 100);
});

test("few samples, no time or a new session give no rate", () => {
  assert.equal(fed([]), null);
  assert.equal(
    fed([
      [0, 0],
      [0.1, 10],
    ]),
    null,
  );
  assert.equal(
    fed([
      [null, 0],
      [1, 100],
    ]),
    null,
  );
  assert.equal(
    fed([
      [100, 9000],
      [0.5, 50],
      [0.6, 60],
    ]),
    null,
  );
});
