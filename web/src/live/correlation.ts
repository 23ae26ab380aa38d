/** Whether the ball follows its commands, and which way round: told by correlations. */

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

/** How the ball's acceleration along an axis goes with that axis' own command and with the other's. */
export interface Correlations {
  own: number;
  other: number;
}

export type SignVerdict = "agrees" | "reversed" | "swapped" | "unclear";

/** Correlations at least so strong count; measured on simulated rigs, healthy ones come to 0.8 and more. */
const STRONG = 0.4;

/** How much stronger the other command's must be before the axes count as swapped. */
const CLEARLY = 1.5;

export function judgeSign({ own, other }: Correlations): SignVerdict {
  if (Number.isNaN(own)) return "unclear";
  if (Math.abs(other) > STRONG && Math.abs(other) > CLEARLY * Math.abs(own)) return "swapped";
  if (Math.abs(own) < STRONG) return "unclear";
  return own > 0 ? "agrees" : "reversed";
}
