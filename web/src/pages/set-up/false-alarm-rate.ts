import { count, number } from "../../words/numbers";

/** Formats the rate per hour that false alarms stay below, in the most readable unit. */
export function falseAlarmRate(perHour?: number | null): string {
  if (perHour == null) return "unknown";
  const perDay = 24 * perHour;
  if (perDay >= 24) return `fewer than ${number(perHour, 1)} per hour`;
  const days = Math.floor(1 / perDay);
  return days <= 1 ? `fewer than ${number(perDay, 1)} per day` : `fewer than one in ${count(days)} days`;
}
