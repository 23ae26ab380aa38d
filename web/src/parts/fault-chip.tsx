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
  /** Whether something beside it says that no data arrive. */
  isShort?: boolean;
}

/** A fault, its state, and since when. */
export function FaultChip({ fault, presence, since, isShort = false }: Props) {
  const title = faultTitle(fault);
  const text = stateText(fault, presence, since ? sinceText(since) : undefined);
  // Up to the comma it says what the test found, and when.
  const shown = isShort ? text.split(",")[0] : text;
  return (
    <span class={chipClass(fault)} title={`${title}: ${text}`}>
      <b>{faultTitle(fault, true)}</b> <span>{shown}</span>
    </span>
  );
}
