import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import { isBusy } from "../../api/request";
import type { FaultEntry, FaultRecording, Trace } from "../../api/types";
import { useQuery, type Query } from "../../hooks/use-query";

/** Range around the occurrence, s. */
const RANGE = { before_s: 6, after_s: 6 };

/** Most moments of the trace. */
const POINTS = 12_000;

/** Time by which a complete recording may end before its range does, s. */
const TOLERANCE_S = 0.5;

/** Delay before an incomplete recording of a running session is fetched again, ms. */
const RETRY_MS = 1000;

/** The seconds around a fault: what was recorded, and what its monitor decided on. */
export interface FaultMoment {
  recording: FaultRecording;
  /** The judged moments with evidence, counters and thresholds; undefined if there are none. */
  trace?: Trace;
  /** Why there is no trace. */
  refused?: unknown;
}

async function fetchMoment({ asset, code }: FaultEntry): Promise<FaultMoment> {
  const recording = await api.faultRecording(asset, code, RANGE);
  const { session_id, from_s, to_s } = recording;
  try {
    const trace = await api.trace(session_id, { from_s, to_s, points: POINTS });
    return { recording, trace: trace.t_s.length ? trace : undefined };
  } catch (refused) {
    return { recording, refused };
  }
}

const isComplete = ({ recording: { complete, columns, to_s }, refused }: FaultMoment) =>
  !isBusy(refused) && (complete || (columns.t_s.at(-1) ?? -Infinity) >= to_s - TOLERANCE_S);

/** The moment of the last occurrence of a fault, fetched again until it is complete. */
export function useFaultMoment(fault: FaultEntry | undefined): Query<FaultMoment | undefined> {
  const session = fault?.last_occurrence?.session_id;
  const fetch = async () => (fault && session ? fetchMoment(fault) : undefined);
  const key = `${fault?.asset} ${fault?.code} ${session} ${fault?.onset_s}`;
  const query = useQuery(fetch, key);
  const { data, refetch } = query;
  useEffect(() => {
    if (!data || isComplete(data)) return;
    const timer = setTimeout(() => void refetch(), RETRY_MS);
    return () => clearTimeout(timer);
  }, [data, refetch]);
  return query;
}
