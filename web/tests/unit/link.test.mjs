// How the samples of a rig arrive, in words.
import assert from "node:assert/strict";
import { test } from "node:test";
import {
  clockText,
  delayText,
  gapsText,
  rateText,
  spacingText,
  unjudgedText,
  unknownText,
} from "../../src/words/link.ts";

const plain = (text) => text.replaceAll("\u202f", " ");

test("rate and spacing have their units, and what is expected", () => {
  assert.equal(plain(rateText({ rate_hz: 100.21 }, 100)), "100.2 per second, 100 expected");
  assert.equal(plain(rateText({ rate_hz: 4.987 }, 5)), "4.99 per second, 5 expected");
  assert.equal(plain(rateText({ rate_hz: 29.9 }, 29.97)), "29.9 per second, 30.0 expected");
  assert.equal(rateText({ rate_hz: null }, 5), "–");
  assert.equal(plain(spacingText({ spacing_s: 0.01, jitter_s: 0.0003 })), "10.0 ms ± 0.3 ms");
  assert.equal(plain(spacingText({ spacing_s: 2, jitter_s: 0.3 })), "2.00 s ± 300.0 ms");
  assert.equal(plain(spacingText({ spacing_s: 0.2, jitter_s: null })), "200.0 ms");
});

test("gaps and delays say how long they are", () => {
  assert.equal(gapsText({ gaps: 0, longest_gap_s: null, gaps_s: 0 }), "none");
  assert.equal(plain(gapsText({ gaps: 1, longest_gap_s: 1.21, gaps_s: 1.21 })), "1, of 1.2 s");
  const three = { gaps: 3, longest_gap_s: 75, gaps_s: 80.5 };
  assert.equal(plain(gapsText(three)), "3, together 1 min 21 s, the longest 1 min 15 s");
  assert.equal(plain(delayText({ delay_s: 0.021, longest_delay_s: 0.5 })), "21.0 ms, at most 500.0 ms");
  assert.equal(delayText({ delay_s: null, longest_delay_s: null }), "–");
});

test("rows that are not judged are told with their reasons", () => {
  const row = (reason, rows) => ({ reason, rows });
  assert.equal(unjudgedText({ unjudged: [] }), "none");
  assert.equal(unjudgedText({ unjudged: [row("form", 2)] }), "2 not readable");
  const two = { unjudged: [row("absurd", 12), row("too_old", 2)] };
  assert.equal(unjudgedText(two), "14: 12 out of range, 2 too old");
});

test("a clock that counts from the start of the device tells no time of day", () => {
  assert.equal(clockText(1.7e9), "does not tell the time of day");
  assert.equal(clockText(-0.2), "agrees with the clock of the service");
  assert.equal(plain(clockText(12.34)), "is 12 s behind the clock of the service");
  assert.equal(plain(clockText(-90)), "is 1 min 30 s ahead of the clock of the service");
  assert.equal(clockText(null), "–");
});

test("keys that are not understood are named with those that are probably meant", () => {
  const unknown = [
    { key: "x", meant: "x_m" },
    { key: "colour", meant: null },
  ];
  assert.equal(unknownText({ unknown }), "x (x_m?), colour");
});
