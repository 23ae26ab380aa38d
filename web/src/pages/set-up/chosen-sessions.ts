/** The choice of the sessions from which the rig is learnt. */
import type { Session } from "../../api/types";
import { sessionLength } from "../../words/session";

/** Recommended duration of the motion for a calibration, s. */
export const MINUTE_S = 60;

/**
 * Returns the proposed choice: the newest session, if it is long enough and has no fault. Earlier
 * sessions may have been recorded before the axes were corrected.
 */
export function proposedSessions(sessions: Session[] = []): ReadonlySet<string> {
  const newest = sessions[0];
  const isUsable = newest && (sessionLength(newest) ?? 0) >= MINUTE_S && !newest.verdict?.faults.length;
  return new Set(isUsable ? [newest.id] : []);
}

/** Returns the choice with one session added or removed. */
export function withChoice(chosen: ReadonlySet<string>, id: string, isWanted: boolean): Set<string> {
  const next = new Set(chosen);
  if (isWanted) next.add(id);
  else next.delete(id);
  return next;
}

/** Returns the total duration of the chosen sessions, s. */
export const totalLength = (sessions: Session[], chosen: ReadonlySet<string>) =>
  sessions
    .filter(({ id }) => chosen.has(id))
    .reduce((sum, session) => sum + (sessionLength(session) ?? 0), 0);
