/** The report of a fault, to print. */
import { api } from "../../api/client";
import type { FaultCode } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { Facts } from "../../parts/facts";
import { UnloadedPage } from "../../parts/unloaded-page";
import { faultPath } from "../../router/paths";
import { codeTitle, faultTitle } from "../../words/fault-names";
import { AdviceCard } from "../fault/advice-card";
import { EvidenceTable } from "../fault/evidence-table";
import { faultFacts } from "../fault/fault-facts";
import { FaultSummary } from "../fault/fault-summary";
import { RecordingCharts } from "../fault/recording-charts";
import { Certificate } from "./certificate";
import { ReportFrame } from "./report-frame";

/** Range of the charts around the occurrence. */
const RANGE = { before_s: 6, after_s: 6 };

export function FaultReport({ name, code }: { name: string; code: FaultCode }) {
  const title = `${codeTitle(code)} of ${name}`;
  useTitle(`Report of ${title}`);
  const fault = useQuery(() => api.fault(name, code), `${name} ${code}`);
  const asset = useQuery(() => api.asset(name), name);
  const history = useQuery(() => api.history(name, code), `${name} ${code} history`);
  const error = fault.error ?? asset.error;
  if (!fault.data || !asset.data)
    return <UnloadedPage title={title} what="the fault" kind="fault" error={error} retry={fault.refetch} />;
  const { kind, axis, freeze_frame, last_occurrence } = fault.data;
  return (
    <ReportFrame title={`${faultTitle(code, kind)} of ${name}`} back={faultPath(name, code)}>
      <FaultSummary fault={fault.data} history={history.data?.items ?? []} />
      <AdviceCard fault={fault.data} />
      <Facts facts={faultFacts(fault.data)} />
      {last_occurrence && <ReportCharts name={name} code={code} axis={axis} />}
      {freeze_frame && (
        <section>
          <h2>Evidence at the first failure of the last occurrence</h2>
          <EvidenceTable evidence={freeze_frame} />
        </section>
      )}
      {last_occurrence && (
        <Certificate
          asset={asset.data}
          session={last_occurrence.session_id}
          id={last_occurrence.calibration_id}
        />
      )}
    </ReportFrame>
  );
}

type ChartsProps = { name: string; code: FaultCode; axis?: "x" | "y" | null };

function ReportCharts({ name, code, axis }: ChartsProps) {
  const fetchRecording = () => api.faultRecording(name, code, RANGE);
  const { data, error } = useQuery(fetchRecording, `${name} ${code} recording`);
  if (data) return <RecordingCharts recording={data} axis={axis} />;
  return error ? <p class="quiet">The recording is not stored any more.</p> : null;
}
