/** Formats numbers with a true minus sign and a narrow space before the unit. */

/** The text for a missing number. */
export const NONE = "–";

/** Formats a number with `digits` decimals and its unit; a missing number as a dash. */
export function number(value: number | null | undefined, digits: number, unit = ""): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const rounded = value.toFixed(digits);
  const text = Number(rounded) === 0 ? rounded.replace("-", "") : rounded.replace("-", "−");
  return unit ? `${text}\u202f${unit}` : text;
}

export const degrees = (rad: number | null | undefined, digits = 1) =>
  rad === null || rad === undefined ? NONE : `${number((rad * 180) / Math.PI, digits)}°`;

export const millimetres = (m: number | null | undefined, digits = 1) =>
  number(m === null || m === undefined ? m : m * 1e3, digits, "mm");

export const seconds = (s: number | null | undefined, digits = 2) => number(s, digits, "s");

/** Formats an integer in groups of three digits. */
export const count = (n: number) => n.toLocaleString("en").replaceAll(",", "\u202f");

/** Formats a number with its noun: 1 session, 2 sessions. */
export const plural = (n: number, noun: string) => `${count(n)} ${noun}${n === 1 ? "" : "s"}`;
