import { chipClass, stateText } from "../words/fault-state";
import type { FaultState } from "../words/severity";

/** The state of a fault that is named beside the chip. */
export function StatusChip({ fault, hasSession }: { fault: FaultState; hasSession: boolean }) {
  return (
    <span class={chipClass(fault)}>
      <b>{stateText(fault, hasSession)}</b>
    </span>
  );
}
