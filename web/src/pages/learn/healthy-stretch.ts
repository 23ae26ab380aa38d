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
  /** Onset of the first fault after it, s; undefined if the session has none. */
  fault_s?: number;
}

/** Returns the first seconds of a session before its first fault; undefined if they are too few. */
export function healthyStretch(
  { first_t_s: first, last_t_s: last }: Pick<Session, "first_t_s" | "last_t_s">,
  lines: Pick<FaultLine, "t_s" | "onset_s" | "status_byte">[],
): HealthyStretch | undefined {
  if (first == null || last == null) return undefined;
  const onsets = lines.filter(isFailing).map(({ t_s, onset_s }) => Math.min(onset_s ?? t_s, t_s));
  // A fault of the session before may still fail at the first sample.
  const repaired = lines.filter((line) => !isFailing(line)).map(({ t_s }) => t_s);
  const fault_s = onsets.length ? Math.min(...onsets) : undefined;
  const end = fault_s === undefined ? last : fault_s - MARGIN_S;
  const from_s = Math.max(first, ...repaired.filter((t) => t < end - SHORTEST_S));
  const to_s = Math.min(from_s + LONGEST_S, end);
  return to_s - from_s < SHORTEST_S ? undefined : { from_s, to_s, fault_s };
}
