import type { FaultEntry, HistoryEntry } from "../../api/types";
import { ErrorMessage } from "../../parts/error-message";
import { AdviceCard } from "./advice-card";
import { AroundOccurrence } from "./around-occurrence";
import { Causes } from "./causes";
import { FaultHeader } from "./fault-header";
import { FaultSummary } from "./fault-summary";
import { FreezeFrame } from "./freeze-frame";
import { MonitorCard } from "./monitor-card";
import { StatusByte } from "./status-byte";
import { Timeline } from "./timeline";
import { useFaultMoment } from "./use-fault-moment";

interface Props {
  fault: FaultEntry;
  history: HistoryEntry[];
  error: unknown;
  refetch: () => Promise<unknown>;
}

export function FaultDetails({ fault, history, error, refetch }: Props) {
  const { last_occurrence, freeze_frame } = fault;
  const moment = useFaultMoment(fault);
  return (
    <main class="fault">
      <FaultHeader fault={fault} refetch={refetch} />
      <ErrorMessage error={error} />
      <FaultSummary fault={fault} history={history} />
      <div class="pair">
        <div class="column">
          <AdviceCard fault={fault} />
          <Causes fault={fault} />
          <Timeline history={history} code={fault.code} />
        </div>
        <div class="column">
          <StatusByte byte={fault.status_byte} />
          <MonitorCard fault={fault} />
        </div>
      </div>
      {last_occurrence && (
        <AroundOccurrence
          key={`${last_occurrence.session_id} ${fault.onset_s}`}
          fault={fault}
          session={last_occurrence.session_id}
          moment={moment}
        />
      )}
      {freeze_frame && <FreezeFrame evidence={freeze_frame} moment={moment} />}
    </main>
  );
}
