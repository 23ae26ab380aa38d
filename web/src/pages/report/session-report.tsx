/** The report of a session, to print. */
import { useEffect, useMemo } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset, FaultLine, Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { TraceBuffer } from "../../live/buffer";
import { ChartGroup } from "../../parts/charts/chart-group";
import { faultMark } from "../../parts/charts/fault-marks";
import { RigCharts } from "../../parts/charts/rig-charts";
import { ThinnedNote } from "../../parts/charts/thinned-note";
import { Facts } from "../../parts/facts";
import { UnloadedPage } from "../../parts/unloaded-page";
import { VerdictWarnings } from "../../parts/verdict-warnings";
import { sessionPath } from "../../router/paths";
import { changeOf } from "../../words/fault-state";
import { faultTitle } from "../../words/fault-names";
import { count, seconds } from "../../words/numbers";
import { lineSentence } from "../../words/sentence";
import { sessionLength } from "../../words/session";
import { dateTime, duration } from "../../words/time";
import { verdict } from "../../words/verdict";
import { JudgedShares } from "../session/judged-shares";
import { Certificate } from "./certificate";
import { ReportFrame } from "./report-frame";

/** Moments of the charts: more cannot be seen on paper. */
const POINTS = 2000;

/** A promise that never resolves, while the rig of the session is not known yet. */
const never = () => new Promise<Asset>(() => {});

export function SessionReport({ id }: { id: string }) {
  const session = useQuery(() => api.session(id), id);
  const name = session.data?.asset;
  const asset = useQuery(() => (name ? api.asset(name) : never()), name);
  const faults = useQuery(() => api.sessionFaults(id), `${id} faults`);
  useTitle(`Report of ${session.data?.name ?? "a session"}`);
  const error = session.error ?? asset.error;
  if (!session.data || !asset.data)
    return (
      <UnloadedPage title="Report" what="the session" kind="session" error={error} retry={session.refetch} />
    );
  return <Report session={session.data} asset={asset.data} faults={faults.data ?? []} />;
}

function Report({ session, asset, faults }: { session: Session; asset: Asset; faults: FaultLine[] }) {
  const result = session.verdict && verdict(session.verdict, faults);
  return (
    <ReportFrame title={`${session.name} of ${session.asset}`} back={sessionPath(session.id)}>
      <p class={`result ${result?.look ?? "quiet"}`}>{result?.text ?? "The session is open."}</p>
      <VerdictWarnings verdict={session.verdict} asset={session.asset} />
      <Facts
        facts={[
          ["Opened, by the service's clock", dateTime(session.opened_at)],
          ["Ended", session.ended_at ? dateTime(session.ended_at) : "not yet"],
          ["Length, by the device's clock", duration(sessionLength(session))],
          ["Samples", `${count(session.samples)}, ${count(session.rejected ?? 0)} rejected`],
          ["Verdict hash", session.verdict?.verdict_hash ?? "when the session has ended"],
        ]}
      />
      <SessionCharts session={session} faults={faults} />
      <section>
        <h2>What was found</h2>
        {faults.length === 0 && <p>No change of any fault.</p>}
        <ol>
          {faults.map((line) => (
            <li>
              {seconds(line.t_s)}: <b>{faultTitle(line)}</b> {changeOf(line).text}. {lineSentence(line)}
            </li>
          ))}
        </ol>
        <JudgedShares monitors={session.verdict?.monitors ?? []} />
      </section>
      <Certificate asset={asset} session={session.id} />
    </ReportFrame>
  );
}

/** Positions and residuals of the whole session. */
function SessionCharts({ session, faults }: { session: Session; faults: FaultLine[] }) {
  const { data } = useQuery(() => api.trace(session.id, { points: POINTS }), `${session.id} report`);
  const group = useMemo(() => new ChartGroup(), []);
  useEffect(() => {
    const buffer = data && TraceBuffer.of(data);
    if (!buffer?.t.length) return;
    group.setMarks(faults.map(faultMark));
    group.draw(buffer, [buffer.first, buffer.last]);
  }, [data, faults, group]);
  if (!data?.t_s.length) return null;
  return (
    <>
      <ThinnedNote stride={data.stride} hint="The page of the session shows all of them." />
      <RigCharts group={group} kinds={["position", "residual"]} height={130} />
    </>
  );
}
