import type { Evidence } from "../../api/types";
import type { Query } from "../../hooks/use-query";
import { Term } from "../../parts/term";
import { EvidenceTable } from "./evidence-table";
import { decisiveNats } from "./evidence-rows";
import type { FaultMoment } from "./use-fault-moment";

interface Props {
  evidence: Evidence;
  moment: Query<FaultMoment | undefined>;
}

/** The evidence at the first failure of the last occurrence, with what speaks for a fault in red. */
export function FreezeFrame({ evidence, moment: { data, error } }: Props) {
  const thresholds = data?.trace?.thresholds;
  const isLoading = !data && !error;
  return (
    <section class="card">
      <h2>
        <Term of="freezeFrame">Freeze frame</Term>
      </h2>
      <p class="quiet small-text">
        The evidence at the first failure of the last occurrence. Values that indicate a fault are red: a
        residual beyond its limit, or a path that deviates more than a healthy one.{" "}
        {!isLoading && decisiveNats(thresholds)}
      </p>
      <EvidenceTable evidence={evidence} thresholds={thresholds} />
    </section>
  );
}
