import { faultTitle, type Finding } from "../words/fault-names";
import { chipClass, stateText } from "../words/fault-state";
import type { FaultState } from "../words/severity";
import { sinceText } from "../words/time";

interface Props {
  fault: FaultState & Finding;
  /** Whether a session is open. */
  hasSession: boolean;
  /** Time at which the test last began to fail. */
  since?: string | null;
}

/** A fault, its state, and since when. */
export function FaultChip({ fault, hasSession, since }: Props) {
  const title = faultTitle(fault);
  const text = stateText(fault, hasSession, since ? sinceText(since) : undefined);
  return (
    <span class={chipClass(fault)} title={`${title}: ${text}`}>
      <b>{faultTitle(fault, true)}</b> <span>{text}</span>
    </span>
  );
}
