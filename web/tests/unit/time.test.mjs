// Formats of durations: at most two units, with rounding that carries into the larger unit.
import assert from "node:assert/strict";
import { test } from "node:test";
import { duration, timeAgo } from "../../src/words/time.ts";

/** The narrow space before a unit, as a plain one. */
const plain = (text) => text.replaceAll("\u202f", " ");

test("a duration has one decimal below ten seconds and two parts from a minute on", () => {
  const cases = [
    [0, "0.0 s"],
    [9.94, "9.9 s"],
    [12.3, "12 s"],
    [60, "1 min 0 s"],
    [200, "3 min 20 s"],
    [3600, "1 h 0 min"],
    [5400, "1 h 30 min"],
    [90_000, "1 d 1 h"],
  ];
  for (const [seconds, words] of cases) assert.equal(plain(duration(seconds)), words);
  assert.equal(duration(null), "–");
  assert.equal(duration(undefined), "–");
});

test("rounding a duration carries into the larger unit", () => {
  const cases = [
    [9.97, "10 s"],
    [59.97, "1 min 0 s"],
    [119.6, "2 min 0 s"],
    [3599.6, "1 h 0 min"],
    [7199, "2 h 0 min"],
    [86_399, "1 d 0 h"],
    [172_799, "2 d 0 h"],
  ];
  for (const [seconds, words] of cases) assert.equal(plain(duration(seconds)), words);
});

test("no duration shows sixty seconds, sixty minutes or twenty-four hours", () => {
  for (let seconds = 0; seconds < 400_000; seconds += seconds < 8000 ? 0.37 : 61.7) {
    assert.doesNotMatch(plain(duration(seconds)), /\b60 (s|min)|\b24 h|\b10\.0 s/, `${seconds} s`);
  }
});

test("the rounding error of a duration is at most half of its smaller unit", () => {
  const SECONDS = { s: 1, min: 60, h: 3600, d: 86_400 };
  for (let seconds = 60; seconds < 400_000; seconds *= 1.003) {
    const parts = plain(duration(seconds)).match(/\d+ \w+/g);
    const [shown, smallest] = parts.reduce(
      ([sum], part) => {
        const [n, unit] = part.split(" ");
        return [sum + Number(n) * SECONDS[unit], SECONDS[unit]];
      },
      [0, 0],
    );
    // This holds for carried durations too.
    assert.ok(Math.abs(shown - seconds) <= smallest / 2, `${seconds} s is shown as ${shown} s`);
  }
});

test("times relative to now", () => {
  const now = Date.parse("2026-01-01T12:00:00Z");
  const before = (seconds) => plain(timeAgo(new Date(now - seconds * 1000).toISOString(), now));
  assert.equal(before(0.5), "now");
  assert.equal(before(-3), "now", "a clock that is ahead");
  assert.equal(before(5), "5 s ago");
  assert.equal(before(59.97), "1 min 0 s ago");
  assert.equal(before(119.6), "2 min 0 s ago");
  assert.equal(before(3599.6), "1 h 0 min ago");
  assert.equal(timeAgo(null), "never");
});
