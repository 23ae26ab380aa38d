import type { Axis } from "../../api/types";
import type { SignVerdict } from "../../live/correlation";
import { number } from "../../words/numbers";

/** Sign convention of each axis. */
const RULE: Record<Axis, string> = {
  x: "+qy moves the ball toward +x",
  y: "+qx moves the ball toward −y",
};

interface Props {
  axis: Axis;
  verdict: SignVerdict;
  /** Correlation of the ball's acceleration along the axis with the command of that axis. */
  correlation: number;
  flip: () => void;
  swap: () => void;
}

/** The result of the sign check of an axis, with a button that corrects it. */
export function SignRemark({ axis, verdict, correlation, flip, swap }: Props) {
  const strength = number(correlation, 2);
  if (verdict === "agrees")
    return (
      <li class="good">
        {axis}: {RULE[axis]}, as it should (correlation {strength}).
      </li>
    );
  if (verdict === "reversed")
    return (
      <li class="warn">
        {axis}: the ball goes the other way; {RULE[axis]} by convention (correlation {strength}).{" "}
        <button type="button" class="small" onClick={flip}>
          Flip {axis}
        </button>
      </li>
    );
  if (verdict === "swapped")
    return (
      <li class="warn">
        {axis}: the ball follows the other command.{" "}
        <button type="button" class="small" onClick={swap}>
          Swap x and y
        </button>
      </li>
    );
  return (
    <li>
      {axis}: the sign is unclear; the ball hardly follows the command (correlation {strength}).
    </li>
  );
}
