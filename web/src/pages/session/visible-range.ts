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

/** Shortest range that can be zoomed to, s. */
const SHORTEST_S = 0.1;

/** Returns the range as one that can be shown: in order, not too short, and within the recording. */
export function zoomRange([a, b]: [number, number], first: number, last: number): [number, number] {
  const length = Math.min(Math.max(Math.abs(b - a), SHORTEST_S), last - first);
  const from = Math.min(Math.max(Math.min(a, b), first), last - length);
  return [from, from + length];
}

/** Returns a zoomed range moved by `share` of its length. */
export function panned(
  range: [number, number],
  share: number,
  first: number,
  last: number,
): [number, number] {
  const by = share * (range[1] - range[0]);
  return zoomRange([range[0] + by, range[1] + by], first, last);
}
