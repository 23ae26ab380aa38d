import { errorText, isNotFound } from "../../api/request";
import type { FaultEntry } from "../../api/types";
import type { Query } from "../../hooks/use-query";
import { ErrorMessage } from "../../parts/error-message";
import { saveJson } from "../../parts/save-file";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { RecordingCharts } from "./recording-charts";
import type { FaultMoment } from "./use-fault-moment";

interface Props {
  fault: FaultEntry;
  session: string;
  moment: Query<FaultMoment | undefined>;
}

/** The recorded and judged seconds before and after the last occurrence. */
export function AroundOccurrence({ fault, session, moment: { data, error, refetch } }: Props) {
  const recording = data?.recording;
  const start = recording?.onset_s ?? recording?.failed_s;
  const isGone = isNotFound(error);
  return (
    <section class="card">
      <div class="card-head">
        <h2>Before and after</h2>
        <div class="page-tools">
          {recording && (
            <button type="button" onClick={() => saveJson(recording, `${fault.asset}-${fault.code}.json`)}>
              Download JSON
            </button>
          )}
          {!isGone && (
            <Link class="button" to={sessionPath(session, start)}>
              Play the session back
            </Link>
          )}
        </div>
      </div>
      {isGone ? (
        <p class="quiet">The session in which it occurred is not stored any more, and its curves are gone.</p>
      ) : (
        <ErrorMessage error={error} retry={refetch} />
      )}
      {data && <MissingTrace moment={data} />}
      {data && <RecordingCharts moment={data} fault={fault} />}
    </section>
  );
}

/** Says that the curves on which the monitor decided are missing. */
export function MissingTrace({ moment: { trace, refused } }: { moment: FaultMoment }) {
  if (trace) return null;
  return (
    <p class="note small-text">
      <span>
        The weight of evidence and the counter of the monitor could not be computed again; shown is what was
        recorded. {refused !== undefined && errorText(refused)}
      </span>
    </p>
  );
}
