import type { FleetEntry } from "../api/types";
import { driftText, driftTitle } from "../words/drift";
import { sentence } from "../words/sentence";

/** A drifting parameter, and the number of sessions until it is a fault. */
export function DriftChip({ warning }: { warning: FleetEntry["warnings"][number] }) {
  return (
    <span class="chip chip-drift" title={sentence(warning.summary)}>
      <b>{driftTitle(warning)}</b> <span>{driftText(warning)}</span>
    </span>
  );
}
