/** Of the time shown, so much lies before the moment that is played. */
const SHARE_BEFORE = 0.6;

/** A recording is shown over at least this, s, however short it is. */
const LEAST_S = 1;

/** The seconds that the charts show about the moment `t`: `span` of them, or all if it is 0. */
export function visibleRange(t: number, span: number, first: number, last: number): [number, number] {
  if (span === 0) return [first, last];
  const from = Math.max(first, t - span * SHARE_BEFORE);
  return [from, Math.min(from + span, Math.max(last, from + LEAST_S))];
}
