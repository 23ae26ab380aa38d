import type { AssetAxes, Evidence } from "../../api/types";
import { correctedAxes, type Signs } from "../../live/signs";
import { ActionButton } from "../../parts/action-button";
import { seconds } from "../../words/numbers";
import { AFTER_THE_END } from "../../words/session";
import { SignList } from "./sign-list";
import { UnitWarnings } from "./unit-warnings";

/** Duration of tilted samples that the check needs, s. */
const ENOUGH_S = 3;

const isWrong = ({ verdict: { x, y } }: Signs) =>
  [x, y].some((verdict) => verdict === "reversed" || verdict === "swapped");

const sign = (n: number) => (n > 0 ? "+" : "−");

interface Props {
  axes: AssetAxes;
  signs?: Signs;
  evidence?: Evidence;
  change: (axes: Partial<AssetAxes>) => Promise<void>;
  next: () => void;
}

/** The check of the rig's axes, with a button that corrects them. */
export function SignsCard({ axes, signs, evidence, change, next }: Props) {
  const seen = signs?.seconds ?? 0;
  const known = seen >= ENOUGH_S ? signs : undefined;
  const agrees = signs?.verdict.x === "agrees" && signs.verdict.y === "agrees";
  return (
    <section class="card">
      <h2>Signs and units</h2>
      <p>
        Let the rig move the ball, by its controller or by hand. With +qy, the ball must go to the right (+x);
        with +qx, it must go down (−y).
      </p>
      <UnitWarnings evidence={evidence} change={change} />
      {!known && (
        <p role="status">
          {seen > 0
            ? `${seconds(seen, 1)} of ${ENOUGH_S} s with a tilted plate…`
            : "Waiting for the ball to move…"}
        </p>
      )}
      {known && <SignList signs={known} />}
      {known && isWrong(known) && (
        <p>
          <ActionButton class="primary" action={() => change(correctedAxes(axes, known))} needs="operator">
            Correct the axes
          </ActionButton>{" "}
          <span class="quiet">
            Changes the axes in the set-up and ends the session; the device is not changed. {AFTER_THE_END}
          </span>
        </p>
      )}
      <p class="quiet small-text">
        Current axes: {axes.swap ? "x and y swapped, " : ""}x sign {sign(axes.x_sign)}, y sign{" "}
        {sign(axes.y_sign)}, position unit {axes.position_unit_m} m, command unit{" "}
        {Number(axes.command_unit_rad.toFixed(4))} rad.
      </p>
      <div class="form-end">
        <button type="button" class={agrees ? "primary" : ""} onClick={next}>
          {agrees ? "Continue: calibrate the rig" : "Continue anyway"}
        </button>
      </div>
    </section>
  );
}
