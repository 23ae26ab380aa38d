import type { FaultCode, FaultKind } from "../api/types";
import { faultTitle } from "../words/fault-names";
import { chipClass, stateText } from "../words/fault-state";
import type { FaultState } from "../words/severity";
import { sinceText } from "../words/time";

interface Props {
  fault: FaultState & { code: FaultCode; kind?: FaultKind | null };
  /** Whether a session is open, so that the test has a result now. */
  hasSession: boolean;
  /** Time at which the test last began to fail. */
  since?: string | null;
}

/** A fault, its state, and since when. */
export function FaultChip({ fault, hasSession, since }: Props) {
  const when = since && (fault.failing ? ` since ${sinceText(since)}` : `, failed ${sinceText(since)}`);
  return (
    <span class={chipClass(fault)}>
      <b>{faultTitle(fault.code, fault.kind)}</b>{" "}
      <span>
        {stateText(fault, hasSession)}
        {when}
      </span>
    </span>
  );
}
