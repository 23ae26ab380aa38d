import { useEffect, useMemo } from "preact/hooks";
import { api } from "../../api/client";
import type { Profile, Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { TraceBuffer } from "../../live/buffer";
import { ChartGroup } from "../../parts/charts/chart-group";
import { RigCharts } from "../../parts/charts/rig-charts";
import { ErrorMessage } from "../../parts/error-message";
import { duration } from "../../words/time";
import { JudgedFacts } from "./judged-facts";

/** Duration of the shown part of a session, s. */
const SHOWN_S = 20;

/** A session judged with one profile. */
export function JudgedByProfile({ session, profile }: { session: Session; profile: Profile }) {
  const from = session.first_t_s ?? 0;
  const fetchTrace = () => api.trace(session.id, { from_s: from, to_s: from + SHOWN_S, profile });
  const { data: trace, error, refetch } = useQuery(fetchTrace, `${session.id} ${profile}`);
  const group = useMemo(() => new ChartGroup(), []);
  useEffect(() => {
    if (!trace) return;
    const buffer = TraceBuffer.of(trace);
    if (buffer.t.length) group.draw(buffer, [buffer.first, buffer.last]);
  }, [group, trace]);
  return (
    <div>
      <h3>{profile}</h3>
      <ErrorMessage error={error} retry={refetch} />
      <RigCharts group={group} kinds={["residual"]} axes={["x"]} height={170} />
      <JudgedFacts session={session} profile={profile} trace={trace} />
      <p class="quiet small-text">
        The first {duration(Math.min(SHOWN_S, session.last_t_s! - from))}, x axis.
      </p>
    </div>
  );
}
