import type { ReplaySettings } from "../../api/types";

/** What the form of a replay asks for; what is empty stays as it was recorded. */
export interface ReplayForm {
  profile: string;
  /** s, as typed. */
  debounce: string;
  /** Without what was learnt. */
  isUnlearnt: boolean;
}

export function replaySettings({ profile, debounce, isUnlearnt }: ReplayForm): ReplaySettings {
  const asset = {
    ...(debounce ? { diagnostics: { debounce_s: Number(debounce) } } : {}),
    ...(isUnlearnt ? { calibration: null } : {}),
  };
  return { ...(profile ? { profile } : {}), ...(Object.keys(asset).length ? { asset } : {}) };
}
