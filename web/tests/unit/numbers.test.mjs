// Formats of numbers and units.
import assert from "node:assert/strict";
import { test } from "node:test";
import { count, degrees, millimetres, number, plural, seconds } from "../../src/words/numbers.ts";

test("a number has its digits, a true minus sign, and a narrow space before its unit", () => {
  assert.equal(number(1.25, 1), "1.3");
  assert.equal(number(-2, 2, "m/s²"), "−2.00\u202fm/s²");
  assert.equal(seconds(0.123), "0.12\u202fs");
});

test("a number that rounds to zero has no sign", () => {
  assert.equal(number(-0.04, 1), "0.0");
  assert.equal(number(-0, 0), "0");
});

test("a missing number is a dash", () => {
  for (const missing of [null, undefined, NaN, Infinity]) assert.equal(number(missing, 1, "s"), "–");
  assert.equal(degrees(null), "–");
  assert.equal(millimetres(undefined), "–");
});

test("units are converted", () => {
  assert.equal(degrees(Math.PI / 2), "90.0°");
  assert.equal(millimetres(-0.0123, 1), "−12.3\u202fmm");
});

test("counts are in groups of three digits, nouns in singular or plural", () => {
  assert.equal(count(999), "999");
  assert.equal(count(1_234_567), "1\u202f234\u202f567");
  assert.equal(plural(1, "session"), "1 session");
  assert.equal(plural(0, "session"), "0 sessions");
});
