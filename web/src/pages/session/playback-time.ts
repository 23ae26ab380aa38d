/** The current time of a playback. */
import type { TraceBuffer } from "../../live/buffer";
import { ballAt } from "../../live/pose";

/** Longest step of one frame, s: slower frames than that are not playback, and a hidden tab has none. */
const LONGEST_STEP_S = 1;

/** Longest search for the first position of the ball, s. */
const SEARCH_S = 5;

/** Returns the first moment at which the ball's position is known, if it is soon, otherwise the first moment. */
export function firstSeen(buffer: TraceBuffer): number {
  const seen = buffer.t.find((t) => t > buffer.first + SEARCH_S || ballAt(buffer, "position", t));
  return seen !== undefined && seen <= buffer.first + SEARCH_S ? seen : buffer.first;
}

/** Returns the time `elapsed_ms` after `t`, played at `speed` and at most to `last`. */
export const playedOn = (t: number, elapsed_ms: number, speed: number, last: number) =>
  Math.min(t + Math.min(elapsed_ms / 1000, LONGEST_STEP_S) * speed, last);
