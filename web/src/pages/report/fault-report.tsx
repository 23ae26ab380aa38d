/** The report of a fault, to print. */
import { api } from "../../api/client";
import type { FaultCode, FaultEntry } from "../../api/types";
import { useQuery, type Query } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { Facts } from "../../parts/facts";
import { UnloadedPage } from "../../parts/unloaded-page";
import { faultPath } from "../../router/paths";
import { codeTitle, faultTitle } from "../../words/fault-names";
import { AdviceCard } from "../fault/advice-card";
import { MissingTrace } from "../fault/around-occurrence";
import { EvidenceTable } from "../fault/evidence-table";
import { faultFacts } from "../fault/fault-facts";
import { FaultSummary } from "../fault/fault-summary";
import { RecordingCharts } from "../fault/recording-charts";
import { useFaultMoment, type FaultMoment } from "../fault/use-fault-moment";
import { Certificate } from "./certificate";
import { ReportFrame } from "./report-frame";

export function FaultReport({ name, code }: { name: string; code: FaultCode }) {
  const title = `${codeTitle(code)} of ${name}`;
  useTitle(`Report of ${title}`);
  const fault = useQuery(() => api.fault(name, code), `${name} ${code}`);
  const asset = useQuery(() => api.asset(name), name);
  const history = useQuery(() => api.history(name, code), `${name} ${code} history`);
  const moment = useFaultMoment(fault.data);
  const error = fault.error ?? asset.error;
  if (!fault.data || !asset.data)
    return <UnloadedPage title={title} what="the fault" kind="fault" error={error} retry={fault.refetch} />;
  const { freeze_frame, last_occurrence } = fault.data;
  return (
    <ReportFrame title={`${faultTitle(fault.data)} of ${name}`} back={faultPath(name, code)}>
      <FaultSummary fault={fault.data} history={history.data?.items ?? []} />
      <AdviceCard fault={fault.data} />
      <Facts facts={faultFacts(fault.data, true)} />
      {last_occurrence && <ReportCharts fault={fault.data} moment={moment} />}
      {freeze_frame && (
        <section>
          <h2>Evidence at the first failure of the last occurrence</h2>
          <EvidenceTable evidence={freeze_frame} thresholds={moment.data?.trace?.thresholds} />
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

interface ChartsProps {
  fault: FaultEntry;
  moment: Query<FaultMoment | undefined>;
}

function ReportCharts({ fault, moment: { data, error } }: ChartsProps) {
  if (!data) return error ? <p class="quiet">The recording is not stored any more.</p> : null;
  return (
    <>
      <MissingTrace moment={data} />
      <RecordingCharts moment={data} fault={fault} isPrinted />
    </>
  );
}
