import type { ReplaySettings } from "../../api/types";
import type { ProfileOrRecorded } from "./profile-choice";

/** The form of a replay; empty fields keep the settings of the recording. */
export interface ReplayForm {
  profile: ProfileOrRecorded;
  /** Debounce time as typed, s. */
  debounce: string;
  /** Whether to judge without the calibration. */
  isUnlearnt: boolean;
}

export function replaySettings({ profile, debounce, isUnlearnt }: ReplayForm): ReplaySettings {
  const asset = {
    ...(debounce ? { diagnostics: { debounce_s: Number(debounce) } } : {}),
    ...(isUnlearnt ? { calibration: null } : {}),
  };
  return { ...(profile ? { profile } : {}), ...(Object.keys(asset).length ? { asset } : {}) };
}
