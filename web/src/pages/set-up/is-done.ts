import type { Asset } from "../../api/types";
import type { SetUpStep } from "../../router/paths";

/** Whether a step of the set-up is done; a rig that is learnt was connected, and its signs were right. */
export function isDone(step: SetUpStep, asset: Asset | undefined, hasSamples: boolean): boolean {
  const isLearnt = asset?.calibration != null;
  return {
    describe: asset !== undefined,
    connect: hasSamples || isLearnt,
    check: isLearnt,
    learn: isLearnt,
  }[step];
}
