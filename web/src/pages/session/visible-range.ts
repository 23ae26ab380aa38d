/** Fraction of the visible range before the current time. */
const SHARE_BEFORE = 0.6;

/** Smallest visible range, s. */
const MIN_S = 1;

/** Returns the range of the charts around the time `t`, `span` seconds long, or everything if `span` is 0. */
export function visibleRange(t: number, span: number, first: number, last: number): [number, number] {
  if (span === 0) return [first, last];
  const from = Math.max(first, t - span * SHARE_BEFORE);
  return [from, Math.min(from + span, Math.max(last, from + MIN_S))];
}
