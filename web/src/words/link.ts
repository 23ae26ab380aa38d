/** Words about how the samples of a rig arrive. */
import type { LinkStretch, RigLink, UnjudgedReason } from "../api/types";
import { count, NONE, number } from "./numbers";
import { duration } from "./time";

const REASONS: Record<UnjudgedReason, string> = {
  form: "not readable",
  not_finite: "not a number",
  absurd: "out of range",
  conflict: "with other values than an earlier row of the same number or time",
  too_old: "too old",
  session_ended: "of a session that has ended",
  late: "too late",
  jump: "with a time that no other row confirmed",
};

/** Offset from which on the device's clock does not tell the time of day, s. */
const OTHER_CLOCK_S = 86_400;

/** Difference that a batch on its way may explain, s. */
const ON_ITS_WAY_S = 0.5;

/** Formats an interval: in milliseconds below a second. */
function interval(s: number | null | undefined): string {
  if (s == null) return NONE;
  return s < 1 ? number(s * 1e3, 1, "ms") : number(s, 2, "s");
}

/** The rate, beside the one that is expected. */
export function rateText({ rate_hz: rate }: LinkStretch, expected: number): string {
  if (rate == null) return NONE;
  const digits = expected < 10 ? 2 : 1;
  return `${number(rate, digits)} per second, ${number(expected, Number.isInteger(expected) ? 0 : digits)} expected`;
}

export const spacingText = ({ spacing_s: spacing, jitter_s: jitter }: LinkStretch): string =>
  jitter == null ? interval(spacing) : `${interval(spacing)} ± ${interval(jitter)}`;

export function gapsText({ gaps, longest_gap_s: longest, gaps_s: all }: LinkStretch): string {
  if (!gaps) return "none";
  if (gaps === 1) return `1, of ${duration(longest)}`;
  return `${count(gaps)}, together ${duration(all)}, the longest ${duration(longest)}`;
}

export const delayText = ({ delay_s: mean, longest_delay_s: longest }: LinkStretch): string =>
  mean == null ? NONE : `${interval(mean)}, at most ${interval(longest)}`;

export function unjudgedText({ unjudged }: LinkStretch): string {
  const [first] = unjudged;
  if (!first) return "none";
  if (unjudged.length === 1) return `${count(first.rows)} ${REASONS[first.reason]}`;
  const all = unjudged.reduce((sum, { rows }) => sum + rows, 0);
  return `${count(all)}: ${unjudged.map(({ rows, reason }) => `${count(rows)} ${REASONS[reason]}`).join(", ")}`;
}

/** The keys of the telemetry that are not understood: x (x_m?). */
export const unknownText = ({ unknown }: Pick<RigLink, "unknown">): string =>
  unknown.map(({ key, meant }) => (meant ? `${key} (${meant}?)` : key)).join(", ");

/** How far the device's clock is behind that of the service by `offset`, s. */
export function clockText(offset: number | null | undefined): string {
  if (offset == null) return NONE;
  if (Math.abs(offset) >= OTHER_CLOCK_S) return "does not tell the time of day";
  if (Math.abs(offset) < ON_ITS_WAY_S) return "agrees with the clock of the service";
  return `is ${duration(Math.abs(offset))} ${offset > 0 ? "behind" : "ahead of"} the clock of the service`;
}
