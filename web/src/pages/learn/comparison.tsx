import { useEffect, useMemo } from "preact/hooks";
import { api } from "../../api/client";
import type { Profile, Session, Trace } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import { useQuery } from "../../hooks/use-query";
import { ErrorMessage } from "../../parts/error-message";
import { number, seconds } from "../../words/numbers";
import { duration } from "../../words/time";
import { healthyStretch, type HealthyStretch } from "./healthy-stretch";
import { JudgedByProfile } from "./judged-by-profile";

const INTERVAL_MS = 5000;

/** The largest residual or limit along x of all traces, m/s². */
function commonExtent(traces: Trace[]): number {
  const values = traces.flatMap(({ x }) =>
    x.limit_m_s2.map((limit, i) => {
      const residual = (x.measured_m_s2[i] ?? 0) - (x.twin_m_s2[i] ?? 0);
      return Math.max(Math.abs(residual), limit);
    }),
  );
  return values.reduce((most, value) => Math.max(most, value), 0);
}

function useTraces(session: Session, stretch: HealthyStretch) {
  const { from_s, to_s } = stretch;
  const of = (profile: Profile) => api.trace(session.id, { from_s, to_s, profile });
  const fetchBoth = () => Promise.all([of("default"), of("textbook")]);
  return useQuery(fetchBoth, `${session.id} ${from_s} ${to_s}`);
}

/** The same healthy stretch of a session, judged with both profiles and drawn to the same scale. */
function Stretch({ session, stretch }: { session: Session; stretch: HealthyStretch }) {
  const { data: traces, error, refetch } = useTraces(session, stretch);
  const extent = useMemo(() => commonExtent(traces ?? []), [traces]);
  const { from_s, to_s, fault_s } = stretch;
  return (
    <>
      <p class="quiet small-text">
        {number(from_s, 1)}–{seconds(to_s, 1)} along x ({duration(to_s - from_s)} without a fault),{" "}
        {fault_s === undefined ? "no later fault." : `next fault at ${seconds(fault_s, 1)}.`}
      </p>
      <ErrorMessage error={error} retry={refetch} />
      <div class="pair">
        <JudgedByProfile session={session} profile="default" trace={traces?.[0]} extent={extent} />
        <JudgedByProfile session={session} profile="textbook" trace={traces?.[1]} extent={extent} />
      </div>
    </>
  );
}

/** A session judged with both profiles, as far as it is without a fault; `unfit` is called if it has no such part. */
export function Comparison({ session, unfit }: { session: Session; unfit: (id: string) => void }) {
  const {
    data: lines,
    error,
    refetch,
  } = useQuery(() => api.sessionFaults(session.id), session.id, INTERVAL_MS);
  const latestUnfit = useLatest(unfit);
  const isUnfit = lines !== undefined && !healthyStretch(session, lines);
  useEffect(() => {
    if (isUnfit) latestUnfit.current(session.id);
  }, [isUnfit, session.id, latestUnfit]);
  if (!lines) return <ErrorMessage error={error} retry={refetch} />;
  const stretch = healthyStretch(session, lines);
  if (!stretch)
    return <p class="note">This session has no few seconds without a fault yet. Choose another one.</p>;
  return <Stretch session={session} stretch={stretch} />;
}
