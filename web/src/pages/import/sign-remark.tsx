import type { Axis } from "../../api/types";
import type { SignVerdict } from "../../live/correlation";
import { number } from "../../words/numbers";

/** Which way the ball must go. */
const RULE: Record<Axis, string> = {
  x: "+qy moves the ball toward +x",
  y: "+qx moves the ball toward −y",
};

interface Props {
  axis: Axis;
  verdict: SignVerdict;
  /** Of the ball's acceleration along the axis with the axis' own command. */
  correlation: number;
  flip: () => void;
  swap: () => void;
}

/** Whether the ball goes the right way along an axis, and a button that puts it right. */
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
        {axis}: the ball goes the other way ({RULE[axis]} is the rule; correlation {strength}).{" "}
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
      {axis}: cannot tell the sign; the ball hardly moves with the command (correlation {strength}).
    </li>
  );
}
