/** The numbers along the axis of a chart. */
import { number } from "../../words/numbers";

/** Most decimals of a number. */
const MOST_DIGITS = 6;

/** Returns the decimals with which multiples of `step` differ from each other, at least `digits`. */
export function digitsFor(step: number, digits: number): number {
  let enough = digits;
  const isExact = (n: number) => Math.abs(step * 10 ** n - Math.round(step * 10 ** n)) < 1e-6;
  while (enough < MOST_DIGITS && !isExact(enough)) enough++;
  return enough;
}

/** Returns the labels of `values`, which are `step` apart, with at least `digits` decimals. */
export const valueLabels = (values: (number | null)[], step: number, digits: number): string[] =>
  values.map((value) => (value === null ? "" : number(value, digitsFor(step, digits))));

/** Most numbers along the axis of values, in a low chart and in any. */
const MOST_LABELS_LOW = 5;
const MOST_LABELS = 7;

/** Least distance of two numbers, px, at the usual size of text: chosen for digits of 9 px. */
const LABEL_PX = 13;

/**
 * Returns the step between the numbers of an axis of `px` from `low` to `high`: the smallest round one with which they
 * are few enough. The next greater one is at most twice as large, so that they are not fewer than needed.
 */
export function valueStep(low: number, high: number, px: number): number {
  const most = Math.min(Math.max(Math.floor(px / LABEL_PX), MOST_LABELS_LOW), MOST_LABELS);
  const magnitude = Math.floor(Math.log10((high - low) / most));
  for (let exponent = magnitude; ; exponent++)
    for (const factor of [1, 2, 2.5, 5]) {
      // Digits, not a product: uPlot knows its steps by their exact values.
      const step = Number(`${factor}e${exponent}`);
      if (Math.floor(high / step) - Math.ceil(low / step) < most) return step;
    }
}

/** Returns the range of an axis that shows `low` to `high`, with a margin, and zero in any case. */
export function valueRange(
  low: number | null,
  high: number | null,
  minExtent: number,
  isPositive: boolean,
): [number, number] {
  const bottom = isPositive ? 0 : Math.min(Number.isFinite(low) ? low! : 0, -minExtent);
  const top = Math.max(Number.isFinite(high) ? high! : 0, minExtent);
  // A chart without any value has a range, too.
  const margin = top > bottom ? (top - bottom) * 0.08 : 1;
  return [bottom - margin, top + margin];
}

/** Returns the least and greatest value of `lines`; undefined without any. */
export function extentOf(lines: (number | null)[][]): [number, number] | undefined {
  let [least, most] = [Infinity, -Infinity];
  for (const line of lines)
    for (const value of line) {
      if (value === null || value === undefined) continue;
      least = Math.min(least, value);
      most = Math.max(most, value);
    }
  return least <= most ? [least, most] : undefined;
}
