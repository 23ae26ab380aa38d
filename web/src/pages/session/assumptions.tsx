import type { Asset, Session } from "../../api/types";
import { Link } from "../../router/link";
import { setUpPath } from "../../router/paths";
import { dimensions, hasDefaultDimensions } from "../../words/dimensions";

/** Whether the session was judged without a calibration; an open one is judged with that of the rig. */
function isUnlearnt({ verdict }: Session, { calibration }: Asset): boolean {
  const monitors = verdict?.monitors ?? [];
  return monitors.length ? monitors.some(({ outcome }) => outcome === "not learnt") : !calibration;
}

/** What a verdict without a calibration rests on: the dimensions of the rig, which may never have been entered. */
export function Assumptions({ session, asset }: { session: Session; asset: Asset }) {
  if (!isUnlearnt(session, asset)) return null;
  const isDefault = hasDefaultDimensions(asset);
  return (
    <p class="note small-text">
      <b>Not calibrated.</b> Judged without a calibration, with {isDefault ? "the default" : "these"}{" "}
      dimensions: {dimensions(asset)}. Only sensor faults can be confirmed.{" "}
      <Link to={setUpPath(asset.name, isDefault ? "describe" : "learn")}>
        {isDefault ? "Enter the dimensions of this rig" : "Calibrate this rig"}
      </Link>
    </p>
  );
}
