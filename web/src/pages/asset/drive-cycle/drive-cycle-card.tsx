import { useState } from "preact/hooks";
import { api } from "../../../api/client";
import type { Asset, DriveCycle } from "../../../api/types";
import { ActionButton } from "../../../parts/action-button";
import { Term } from "../../../parts/term";
import { DriveCycleDetails } from "./drive-cycle-details";

/** The drive cycle: the shortest motion in which every monitor has a result, with downloads. */
export function DriveCycleCard({ asset }: { asset: Asset }) {
  const [cycle, setCycle] = useState<DriveCycle>();
  const compute = async () => setCycle(await api.driveCycle(asset.name));
  return (
    <section class="card" id="drive-cycle">
      <h2>
        <Term of="driveCycle">Drive cycle</Term>
      </h2>
      <p class="quiet">
        A short motion in which every monitor has a result. Run it at the start of a day, or if a verdict is
        “cannot tell”.
      </p>
      {!asset.calibration && (
        <p>Neither the servos nor the ball can be tested before the rig is calibrated.</p>
      )}
      {asset.calibration && !cycle && <ActionButton action={compute}>Compute the drive cycle</ActionButton>}
      {cycle && <DriveCycleDetails cycle={cycle} />}
    </section>
  );
}
