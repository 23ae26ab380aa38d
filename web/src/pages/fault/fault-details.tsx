import type { FaultEntry, HistoryEntry } from "../../api/types";
import { ErrorMessage } from "../../parts/error-message";
import { AdviceCard } from "./advice-card";
import { AroundOccurrence } from "./around-occurrence";
import { Causes } from "./causes";
import { EvidenceTable } from "./evidence-table";
import { FaultHeader } from "./fault-header";
import { FaultSummary } from "./fault-summary";
import { MonitorCard } from "./monitor-card";
import { StatusByte } from "./status-byte";
import { Timeline } from "./timeline";

interface Props {
  fault: FaultEntry;
  history: HistoryEntry[];
  error: unknown;
  refetch: () => Promise<unknown>;
}

export function FaultDetails({ fault, history, error, refetch }: Props) {
  const { last_occurrence, freeze_frame } = fault;
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
        />
      )}
      {freeze_frame && (
        <section class="card">
          <h2>Freeze frame</h2>
          <p class="quiet small-text">
            The evidence at the first failure of the last occurrence. What speaks for a fault is red: a
            residual beyond its limit, a weight of evidence of 10 nats and more (confirmed from 13, by
            default), or a path that deviates more than a healthy one.
          </p>
          <EvidenceTable evidence={freeze_frame} />
        </section>
      )}
    </main>
  );
}
