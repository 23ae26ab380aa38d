import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { Choice } from "../../parts/choice";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { Fit } from "./fit";
import { NO_CALIBRATION } from "./history";

/** Most moments of a trace. */
const POINTS = 6000;

interface Props {
  /** Number of the chosen calibration. */
  n: number;
  calibration: string;
  /** The calibration to compare it with. */
  before: string;
  sessions: Session[];
}

/** The traces of a session with both calibrations, one after the other: few are computed at a time. */
async function fetchFit(session: string, before: string, calibration: string) {
  const trace = (calibration: string) => api.trace(session, { points: POINTS, calibration });
  return { before: await trace(before), after: await trace(calibration) };
}

/** The fit of a calibration over the data of a chosen session, beside that of the one before. */
export function FitCard({ n, calibration, before, sessions }: Props) {
  const [session, choose] = useState(sessions[0]?.id);
  const fit = useQuery(
    async () => (session ? fetchFit(session, before, calibration) : undefined),
    `${session} ${before} ${calibration}`,
  );
  if (!session) return null;
  const choices = sessions.map(({ id, name }) => [id, name] as const);
  const other = before === NO_CALIBRATION ? "without a calibration" : `with calibration ${n - 1}`;
  return (
    <section class="card">
      <h2>Fit to the data</h2>
      <Choice isInline label="Session" options={choices} value={session} change={choose} />
      {before === NO_CALIBRATION && (
        <p class="quiet small-text">
          With a calibration, the averaging window adapts to the noise; that alone lowers the residual.
        </p>
      )}
      {fit.data && <Fit traces={fit.data} before={other} after={`with calibration ${n}`} />}
      {!fit.data &&
        (fit.error ? <ErrorMessage error={fit.error} retry={fit.refetch} /> : <Loading what="the fit" />)}
    </section>
  );
}
