import { chipClass, stateText, type Presence } from "../words/fault-state";
import type { FaultState } from "../words/severity";

/** The state of a fault that is named beside the chip. */
export function StatusChip({ fault, presence }: { fault: FaultState; presence: Presence }) {
  return (
    <span class={chipClass(fault)}>
      <b>{stateText(fault, presence)}</b>
    </span>
  );
}
