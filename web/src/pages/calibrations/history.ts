/** The calibrations of a rig in words, and which of them is compared with which. */
import type { Calibration, CalibrationJob, TrainingData } from "../../api/types";
import { dateTime } from "../../words/time";

/** What judges without any calibration, as the service calls it. */
export const NO_CALIBRATION = "none";

/** A calibration that is done. */
export type DoneJob = CalibrationJob & { calibration: Calibration };

export const isDone = (job: CalibrationJob): job is DoneJob => !!job.calibration;

/** The calibrations that are done, of a list that begins with the newest, each with its number from 1. */
export function numbered(jobs: CalibrationJob[]): { job: DoneJob; n: number }[] {
  const done = jobs.filter(isDone);
  return done.map((job, i) => ({ job, n: done.length - i }));
}

/** The id of the calibration that was made before `id`, of a list that begins with the newest. */
export function previous(jobs: CalibrationJob[], id: string): string {
  const done = jobs.filter(isDone);
  return done[done.findIndex((job) => job.id === id) + 1]?.id ?? NO_CALIBRATION;
}

export const sessionOf = (data: TrainingData) => (typeof data === "string" ? data : data.session);

/** When and by whom something was done, as far as it is known. */
export const actWords = (at: string, by?: string | null) => dateTime(at) + (by ? ` by ${by}` : "");

/** Whether a calibration is in use, and who put it into use last. */
export function useWords({ active, activated_at, activated_by }: CalibrationJob): string {
  if (!activated_at) return active ? "in use" : "not in use";
  const act = actWords(activated_at, activated_by);
  return active ? `in use since ${act}` : `not in use; last activated ${act}`;
}

/** What a calibration leaves open, in words. */
export function undetermined({ x, y, certificate, prospects }: Calibration): string[] {
  const axes = [
    { name: "x", axis: x },
    { name: "y", axis: y },
  ];
  return [
    ...axes.filter(({ axis }) => !axis).map(({ name }) => `the ${name} servo`),
    ...axes
      .filter(({ axis }) => axis && !axis.rest_s)
      .map(({ name }) => `the tilt at which a resting ball starts along ${name}`),
    ...(certificate?.length ? [] : ["the expected false alarms"]),
    ...(prospects ? [] : ["the detection times"]),
  ];
}
