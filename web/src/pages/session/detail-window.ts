/** Which part of a long recording is fetched with all of its judged moments. */

/** A range of times, s. */
export type Range = [from: number, to: number];

/** Length of a fetched part in shown ranges. */
const RANGES = 5;

/** Shortest fetched part, s. */
const SHORTEST_S = 30;

/** Fraction of the fetched part that may still be ahead when the next part is fetched. */
const AHEAD = 0.25;

/** Returns the longest part with no more than `points` moments, `rate` per second and not quite even, s. */
export const longestDetail = (rate: number, points: number) => (rate > 0 ? (0.9 * points) / rate : 0);

/** Returns the part to fetch around `range`, within the recording `all`. */
export function detailWindow(range: Range, longest: number, all: Range): Range {
  const shown = range[1] - range[0];
  const length = Math.min(Math.max(RANGES * shown, SHORTEST_S), longest);
  const from = Math.max(all[0], range[0] - (length - shown) * AHEAD);
  return [from, Math.min(all[1], from + length)];
}

/** Whether the fetched part covers `range`, and what follows it in the playback. */
export function isCovered(range: Range, fetched: Range, all: Range): boolean {
  const ahead = AHEAD * (range[1] - range[0]);
  return fetched[0] <= range[0] && fetched[1] >= Math.min(range[1] + ahead, all[1]);
}
