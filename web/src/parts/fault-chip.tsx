import type { FaultCode, FaultKind } from "../api/types";
import { faultTitle } from "../words/fault-names";
import { chipClass, stateText } from "../words/fault-state";
import type { FaultState } from "../words/severity";

/** A fault and its state. */
export function FaultChip({ fault }: { fault: FaultState & { code: FaultCode; kind?: FaultKind | null } }) {
  return (
    <span class={chipClass(fault)}>
      <b>{faultTitle(fault.code, fault.kind)}</b> <span>{stateText(fault)}</span>
    </span>
  );
}
