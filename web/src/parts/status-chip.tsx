import { chipClass, standingText } from "../words/fault-standing";
import type { FaultStanding } from "../words/severity";

/** How a fault stands, where the fault itself is named beside it. */
export function StatusChip({ fault }: { fault: FaultStanding }) {
  return (
    <span class={chipClass(fault)}>
      <b>{standingText(fault)}</b>
    </span>
  );
}
