/** The part of a session without a fault that the lesson shows. */
import type { FaultLine, Session } from "../../api/types";
import { isFailing } from "../../words/status-byte";

/** Longest shown part, s. */
const LONGEST_S = 20;

/** Shortest part that shows something, s. */
const SHORTEST_S = 4;

/** Time before the onset of a fault that is left out, s: an onset is an estimate. */
const MARGIN_S = 1;

export interface HealthyStretch {
  from_s: number;
  to_s: number;
  /** Onset of the first fault after it, s; undefined if there is none. */
  fault_s?: number;
}

type Line = Pick<FaultLine, "t_s" | "onset_s" | "code" | "status_byte">;

/** Returns the intervals in which no fault fails, in order; the last one goes on. */
function healthyIntervals(first: number, lines: Line[]): HealthyStretch[] {
  const intervals: HealthyStretch[] = [];
  const failing = new Set<string>();
  let from_s = first;
  for (const line of [...lines].sort((a, b) => a.t_s - b.t_s)) {
    if (isFailing(line)) {
      const fault_s = Math.min(line.onset_s ?? line.t_s, line.t_s);
      if (!failing.size) intervals.push({ from_s, to_s: fault_s - MARGIN_S, fault_s });
      failing.add(line.code);
    } else {
      failing.delete(line.code);
      // Also a fault of the session before, which still failed at the first sample.
      from_s = line.t_s;
    }
  }
  return failing.size ? intervals : [...intervals, { from_s, to_s: Infinity }];
}

/** Returns the first seconds of a session in which nothing fails; undefined if they are too few. */
export function healthyStretch(
  { first_t_s: first, last_t_s: last }: Pick<Session, "first_t_s" | "last_t_s">,
  lines: Line[],
): HealthyStretch | undefined {
  if (first == null || last == null) return undefined;
  return healthyIntervals(first, lines)
    .map(({ from_s, to_s, fault_s }) => ({ from_s, to_s: Math.min(from_s + LONGEST_S, to_s, last), fault_s }))
    .find(({ from_s, to_s }) => to_s - from_s >= SHORTEST_S);
}
