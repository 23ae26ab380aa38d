import { api } from "../../api/client";
import type { Asset, FaultLine, Session, Trace } from "../../api/types";
import { useQuery } from "../../hooks/use-query";

/** Most moments of a trace. */
const POINTS = 6000;

/** A recorded session with what is drawn of it. */
export interface Recording {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
  trace: Trace;
}

async function fetchRecording(id: string): Promise<Recording> {
  const session = await api.session(id);
  const [asset, faults, trace] = await Promise.all([
    api.asset(session.asset),
    api.sessionFaults(id),
    api.trace(id, { points: POINTS }),
  ]);
  return { session, asset, faults, trace };
}

/** The recordings of both sessions, fetched one after the other: the service computes few traces at a time. */
export const useRecordings = (a: string, b: string) =>
  useQuery(async () => ({ a: await fetchRecording(a), b: await fetchRecording(b) }), `${a} ${b}`);
