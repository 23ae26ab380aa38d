import type { Asset, AxisCalibration, State } from "../../api/types";
import { Facts, type Fact } from "../../parts/facts";
import { Term } from "../../parts/term";
import { navigate } from "../../router/navigation";
import { setUpPath } from "../../router/paths";
import { dimensions, hasDefaultDimensions } from "../../words/dimensions";
import { count, NONE, number } from "../../words/numbers";
import { dateTime } from "../../words/time";

/** The calibration of both servos. */
function servoFacts({ calibration }: Asset): Fact[] {
  const { x, y } = calibration ?? {};
  if (!x || !y) return [];
  const delay = (axis: AxisCalibration) => number((axis.dead_time_s + axis.lag_s) * 1e3, 0, "ms");
  return [
    ["Gain x, y", `${number(x.gain, 3)}, ${number(y.gain, 3)}`],
    ["Delay x, y", `${delay(x)}, ${delay(y)}`],
  ];
}

/** The twin with which the rig is compared. */
export function TwinCard({ asset, state }: { asset: Asset; state?: State }) {
  const { calibration } = asset;
  const calibrated =
    calibration && `${dateTime(calibration.made_at)}, from ${count(calibration.samples)} samples`;
  return (
    <section class="card">
      <h2>
        The <Term of="twin">twin</Term>
      </h2>
      <Facts
        facts={[
          ["Plant model", state?.fidelity ?? NONE],
          ["Reason", state?.fidelity_reason ?? NONE],
          ["Dimensions", dimensions(asset) + (hasDefaultDimensions(asset) ? " (the defaults)" : "")],
          ["Profile", asset.diagnostics?.profile ?? "default"],
          ["Calibrated", calibrated ?? "not yet"],
          ...servoFacts(asset),
        ]}
      />
      <p>
        <button type="button" class="link" onClick={() => navigate(setUpPath(asset.name))}>
          Edit set-up
        </button>
      </p>
    </section>
  );
}
