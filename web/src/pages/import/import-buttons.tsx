import { ActionButton } from "../../parts/action-button";
import { count } from "../../words/numbers";
import type { Mapping } from "./mapping";
import { QUANTITIES, QUANTITY_TITLES, type Quantity } from "./quantities";

/** The required quantities; a recording without commands can be imported. */
const REQUIRED: Quantity[] = ["t_s", "x_m", "y_m"];

interface Props {
  mapping: Mapping;
  /** Number of rows with a time. */
  nRows: number;
  /** Number of rows with a time and a position. */
  nSeen: number;
  hasAsset: boolean;
  send: () => Promise<void>;
  cancel: () => void;
}

/** Why the recording cannot be imported yet; empty if it can. */
function obstacle({ mapping, nRows, nSeen, hasAsset }: Omit<Props, "send" | "cancel">): string {
  const missing = REQUIRED.filter((quantity) => mapping[quantity].index === null);
  if (missing.length)
    return `Choose the column of: ${missing.map((quantity) => QUANTITY_TITLES[quantity]).join(", ")}.`;
  if (nRows < 2) return "The column of the time has no numbers: a time is a number of seconds, ms or µs.";
  if (nSeen < 2) return "No row has both coordinates of the ball as numbers.";
  return hasAsset ? "" : "Choose the rig.";
}

export function ImportButtons({ send, cancel, ...recording }: Props) {
  const { mapping, nRows } = recording;
  const problem = obstacle(recording);
  const absent = QUANTITIES.filter((quantity) => mapping[quantity].index === null);
  return (
    <div class="form-end">
      <span class={problem ? "late" : "quiet"} role="status">
        {problem ||
          (absent.length > 0 &&
            `Not assigned: ${absent.map((quantity) => QUANTITY_TITLES[quantity]).join(", ")}`)}
      </span>
      <button type="button" onClick={cancel}>
        Cancel
      </button>
      <ActionButton class="primary" action={send} disabled={problem !== ""} needs="operator">
        Import {count(nRows)} rows
      </ActionButton>
    </div>
  );
}
