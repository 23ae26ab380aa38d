/** Correlations that show whether the ball follows its commands, and in which direction. */

/** Pearson's correlation coefficient; NaN for fewer than five values or constant values. */
export function correlation(a: number[], b: number[]): number {
  const n = a.length;
  if (n < 5) return NaN;
  const meanA = a.reduce((sum, value) => sum + value, 0) / n;
  const meanB = b.reduce((sum, value) => sum + value, 0) / n;
  let ab = 0;
  let aa = 0;
  let bb = 0;
  for (let i = 0; i < n; i++) {
    const fromMeanA = a[i]! - meanA;
    const fromMeanB = b[i]! - meanB;
    ab += fromMeanA * fromMeanB;
    aa += fromMeanA * fromMeanA;
    bb += fromMeanB * fromMeanB;
  }
  return aa > 0 && bb > 0 ? ab / Math.sqrt(aa * bb) : NaN;
}

/** Correlation of the ball's acceleration along an axis with the command of that axis and of the other axis. */
export interface Correlations {
  own: number;
  other: number;
}

export type SignVerdict = "agrees" | "reversed" | "swapped" | "unclear";

/** Smallest significant correlation; healthy simulated rigs reach 0.8 and more. */
const STRONG = 0.4;

/** Ratio of the other axis' correlation to the own one from which the axes count as swapped. */
const SWAPPED_RATIO = 1.5;

export function judgeSign({ own, other }: Correlations): SignVerdict {
  if (Number.isNaN(own)) return "unclear";
  if (Math.abs(other) > STRONG && Math.abs(other) > SWAPPED_RATIO * Math.abs(own)) return "swapped";
  if (Math.abs(own) < STRONG) return "unclear";
  return own > 0 ? "agrees" : "reversed";
}
