import { useEffect } from "preact/hooks";
import { api } from "../../api/client";
import type { FaultEntry, FaultRecording } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { ErrorMessage } from "../../parts/error-message";
import { saveJson } from "../../parts/save-file";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { RecordingCharts } from "./recording-charts";

/** Range of the charts around the occurrence. */
const RANGE = { before_s: 6, after_s: 6 };

/** Time by which a complete recording may end before its range does, s. */
const TOLERANCE_S = 0.5;

/** Delay before an incomplete recording of a running session is fetched again, ms. */
const RETRY_MS = 1000;

const isComplete = ({ complete, columns, to_s }: FaultRecording) =>
  complete || columns.t_s.at(-1)! >= to_s - TOLERANCE_S;

/** The recorded and judged seconds before and after the last occurrence. */
export function AroundOccurrence({ fault, session }: { fault: FaultEntry; session: string }) {
  const { asset, code } = fault;
  const fetchRecording = () => api.faultRecording(asset, code, RANGE);
  const { data: recording, error, refetch } = useQuery(fetchRecording, `${asset} ${code} recording`);
  useEffect(() => {
    if (!recording || isComplete(recording)) return;
    const timer = setTimeout(() => void refetch(), RETRY_MS);
    return () => clearTimeout(timer);
  }, [recording, refetch]);
  const start = recording?.onset_s ?? recording?.failed_s;
  return (
    <section class="card">
      <div class="card-head">
        <h2>Before and after</h2>
        <div class="page-tools">
          {recording && (
            <button type="button" onClick={() => saveJson(recording, `${asset}-${code}.json`)}>
              Download JSON
            </button>
          )}
          <Link class="button" to={sessionPath(session, start)}>
            Play the session back
          </Link>
        </div>
      </div>
      <ErrorMessage error={error} retry={refetch} />
      {recording && <RecordingCharts recording={recording} axis={fault.axis} />}
    </section>
  );
}
