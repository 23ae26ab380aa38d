import type { Session } from "../../api/types";

/** The rig of the demo. */
const DEMO_RIG = "demo-rig";

const isFaultless = ({ verdict }: Session) => verdict?.faults.length === 0;

/** Criteria for the default session, in the order of preference. */
const PREFERENCES: ((session: Session) => boolean)[] = [
  (session) => isFaultless(session) && session.asset === DEMO_RIG,
  isFaultless,
  (session) => session.state === "ended",
  () => true,
];

/** Returns the session with `id`, otherwise the best example of a healthy rig beyond the textbook's limit. */
export function exampleSession(sessions: Session[], id: string): Session | undefined {
  const wanted = [(session: Session) => session.id === id, ...PREFERENCES];
  for (const isWanted of wanted) {
    const found = sessions.find(isWanted);
    if (found) return found;
  }
  return undefined;
}
