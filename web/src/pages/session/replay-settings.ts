import type { Asset, ReplaySettings } from "../../api/types";
import type { ProfileOrRecorded } from "./profile-choice";

/** The form of a replay; empty fields keep the settings of the recording. */
export interface ReplayForm {
  profile: ProfileOrRecorded;
  /** Debounce time as typed, s. */
  debounce: string;
  /** Whether to judge without the calibration. */
  isUnlearnt: boolean;
  /** Whether to judge with the rig as it is described and calibrated now. */
  isPresent: boolean;
}

/** Returns the change from any description of a rig to its present one; of a plate, one size excludes the other. */
const presentDescription = ({ sample_rate_hz, plate, ball, servo, axes, calibration }: Asset) => ({
  sample_rate_hz,
  plate: plate ? { length_m: null, width_m: null, diameter_m: null, ...plate } : null,
  ball: ball ?? null,
  servo: servo ?? null,
  axes: axes ?? null,
  calibration: calibration ?? null,
});

export function replaySettings(form: ReplayForm, rig: Asset): ReplaySettings {
  const { profile, debounce, isUnlearnt, isPresent } = form;
  const asset = {
    ...(isPresent ? presentDescription(rig) : {}),
    ...(debounce ? { diagnostics: { debounce_s: Number(debounce) } } : {}),
    ...(isUnlearnt ? { calibration: null } : {}),
  };
  return {
    ...(profile ? { profile } : {}),
    ...(Object.keys(asset).length ? { asset } : {}),
  };
}
