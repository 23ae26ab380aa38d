import { chipClass, stateText } from "../words/fault-state";
import type { FaultState } from "../words/severity";

/** The state of a fault that is named beside the chip. */
export function StatusChip({ fault }: { fault: FaultState }) {
  return (
    <span class={chipClass(fault)}>
      <b>{stateText(fault)}</b>
    </span>
  );
}
