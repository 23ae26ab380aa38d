import { faultTitle, type Finding } from "../words/fault-names";
import { chipClass, stateText, type Presence } from "../words/fault-state";
import type { FaultState } from "../words/severity";
import { sinceText } from "../words/time";

interface Props {
  fault: FaultState & Finding;
  /** Whether data of the rig arrive. */
  presence: Presence;
  /** Time at which the test last began to fail. */
  since?: string | null;
}

/** A fault, its state, and since when. */
export function FaultChip({ fault, presence, since }: Props) {
  const title = faultTitle(fault);
  const text = stateText(fault, presence, since ? sinceText(since) : undefined);
  return (
    <span class={chipClass(fault)} title={`${title}: ${text}`}>
      <b>{faultTitle(fault, true)}</b> <span>{text}</span>
    </span>
  );
}
