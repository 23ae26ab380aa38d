/** Which sessions the rig is learnt from. */
import type { Session } from "../../api/types";
import { sessionLength } from "../../words/session";

/** Rolling for so long is what calibration asks for, s. */
export const MINUTE_S = 60;

/**
 * What is proposed: the newest session, if it is long enough and nothing was found in it. An
 * earlier one may have come before the axes were put right.
 */
export function proposedSessions(sessions: Session[] = []): ReadonlySet<string> {
  const newest = sessions[0];
  const isUsable = newest && (sessionLength(newest) ?? 0) >= MINUTE_S && !newest.verdict?.faults.length;
  return new Set(isUsable ? [newest.id] : []);
}

/** The choice with one session added or removed. */
export function withChoice(chosen: ReadonlySet<string>, id: string, isWanted: boolean): Set<string> {
  const next = new Set(chosen);
  if (isWanted) next.add(id);
  else next.delete(id);
  return next;
}

/** How long the chosen sessions are together, s. */
export const totalLength = (sessions: Session[], chosen: ReadonlySet<string>) =>
  sessions
    .filter(({ id }) => chosen.has(id))
    .reduce((sum, session) => sum + (sessionLength(session) ?? 0), 0);
