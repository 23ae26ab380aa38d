import { useState } from "preact/hooks";
import { api } from "../../../api/client";
import type { Asset, DriveCycle } from "../../../api/types";
import { ActionButton } from "../../../parts/action-button";
import { DriveCycleDetails } from "./drive-cycle-details";

/** The drive cycle: the motion in which every monitor comes to a result, to be seen and taken along. */
export function DriveCycleCard({ asset }: { asset: Asset }) {
  const [cycle, setCycle] = useState<DriveCycle>();
  const workOut = async () => setCycle(await api.driveCycle(asset.name));
  return (
    <section class="card" id="drive-cycle">
      <h2>Drive cycle</h2>
      <p class="quiet">
        A short motion in which every monitor comes to a result: for the start of a day, and where a verdict
        says that it cannot tell.
      </p>
      {!asset.calibration && (
        <p>Neither the servos nor the ball can be tested before the rig has been learnt.</p>
      )}
      {asset.calibration && !cycle && <ActionButton action={workOut}>Work it out</ActionButton>}
      {cycle && <DriveCycleDetails cycle={cycle} />}
    </section>
  );
}
