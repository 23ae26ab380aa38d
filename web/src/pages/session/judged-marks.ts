/** The marks of what a session was, or would be, judged to be. */
import type { FaultLine, Trial } from "../../api/types";
import { faultMark } from "../../parts/charts/fault-marks";
import type { Mark } from "../../parts/charts/overlays";
import type { ProfileOrRecorded } from "./profile-choice";
import { alarmMarks, isTried, type TriedSettings } from "./trial";

interface Judged {
  /** The fault lines of the record. */
  faults: FaultLine[];
  /** The profile by which the charts are judged. */
  profile: ProfileOrRecorded;
  tried: TriedSettings;
  /** What the profile and the tried settings find, once it is known. */
  trial?: Trial;
}

/** Returns the faults on record, unless another profile judges, and the alarms of what is tried. */
export function judgedMarks({ faults, profile, tried, trial }: Judged): Mark[] {
  const recorded = profile ? [] : faults.map(faultMark);
  const word = isTried(tried) ? "tried" : profile;
  return word ? [...recorded, ...alarmMarks(trial?.monitors ?? [], word)] : recorded;
}
