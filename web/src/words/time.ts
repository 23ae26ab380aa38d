/** Formats times and durations. */
import { NONE } from "./numbers";

const MINUTE_S = 60;
const HOUR_S = 3600;
const DAY_S = 86_400;

/**
 * Formats a duration with at most two units: 3 min 20 s. It is rounded to the smaller unit before
 * it is split, so that 119.6 s is 2 min 0 s. Intl.DurationFormat does not round, and not every
 * browser in use has it yet.
 */
export function duration(s: number | null | undefined): string {
  if (s === null || s === undefined) return NONE;
  const tenths = s.toFixed(1);
  if (Number(tenths) < 10) return `${tenths}\u202fs`;
  const inSeconds = Math.round(s);
  if (inSeconds < MINUTE_S) return `${inSeconds}\u202fs`;
  if (inSeconds < HOUR_S) return `${Math.floor(inSeconds / 60)}\u202fmin ${inSeconds % 60}\u202fs`;
  const inMinutes = Math.round(s / MINUTE_S);
  if (inMinutes * MINUTE_S < DAY_S) return `${Math.floor(inMinutes / 60)}\u202fh ${inMinutes % 60}\u202fmin`;
  const inHours = Math.round(s / HOUR_S);
  return `${Math.floor(inHours / 24)}\u202fd ${inHours % 24}\u202fh`;
}

/** Returns how long ago `moment` was, in whole seconds below a minute. */
export function timeAgo(moment: string | null | undefined, now = Date.now()): string {
  if (!moment) return "never";
  const s = Math.max(0, (now - Date.parse(moment)) / 1000);
  return s < 2 ? "now" : `${duration(s < MINUTE_S ? Math.round(s) : s).replace(".0", "")} ago`;
}

/** Formats a moment as date and time of day in the browser's locale. */
export const dateTime = (moment: string | null | undefined) =>
  moment ? new Date(moment).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "medium" }) : NONE;

/** Formats the time of day of a moment, to the second. */
export const timeOfDay = (moment: Date) => moment.toLocaleTimeString(undefined, { timeStyle: "medium" });

/** Formats a moment: its time of day if it is today, else with its date. */
export function sinceText(moment: string, now = new Date()): string {
  const at = new Date(moment);
  const time = at.toLocaleTimeString(undefined, { timeStyle: "short" });
  if (at.toDateString() === now.toDateString()) return time;
  return `${at.toLocaleDateString(undefined, { dateStyle: "medium" })}, ${time}`;
}
