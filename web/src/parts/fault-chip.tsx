import { faultTitle } from "../words/fault-names";
import { chipClass, standingText } from "../words/fault-standing";
import type { FaultStanding } from "../words/severity";

/** A fault and how it stands. */
export function FaultChip({ fault }: { fault: FaultStanding & { code: string; kind?: string | null } }) {
  return (
    <span class={chipClass(fault)}>
      <b>{faultTitle(fault.code, fault.kind)}</b> <span>{standingText(fault)}</span>
    </span>
  );
}
