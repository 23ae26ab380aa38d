import { count, number } from "../../words/numbers";

/** Formats a rate per hour in the most readable unit. */
export function falseAlarmRate(perHour?: number | null): string {
  if (perHour == null) return "unknown";
  const perDay = 24 * perHour;
  if (perDay >= 24) return `${number(perHour, 1)} per hour`;
  const days = Math.round(1 / perDay);
  return days <= 1 ? `${number(perDay, 1)} per day` : `one in ${count(days)} days`;
}
