import { number } from "../../words/numbers";

/** A rate per hour in the unit in which it is easiest to imagine. */
export function falseAlarmRate(perHour?: number | null): string {
  if (perHour == null) return "unknown";
  const perDay = 24 * perHour;
  if (perDay >= 24) return `${number(perHour, 1)} an hour`;
  return perDay >= 1 ? `${number(perDay, 1)} a day` : `one in ${number(1 / perDay, 0)} days`;
}
