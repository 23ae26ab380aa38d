import { duration } from "../../words/time";
import { number } from "../../words/numbers";
import type { LikelyUnit } from "./time-unit";

interface Props {
  unit: LikelyUnit;
  /** The samples per second that the rig's description states. */
  rate: number;
  /** Takes the time to be in the likely unit. */
  correct: () => void;
}

/** A remark on a time whose unit is probably wrong, with a button that corrects it. */
export function TimeRemark({ unit: { word, spacing }, rate, correct }: Props) {
  return (
    <li class="warn">
      A row comes every {duration(spacing)}, but the rig sends {number(rate, 0)} per second: is the time in{" "}
      {word}?{" "}
      <button type="button" class="small" onClick={correct}>
        Time is in {word}
      </button>
    </li>
  );
}
