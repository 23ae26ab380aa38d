import type { Trace } from "../../api/types";

export interface Shares {
  /** Fraction of all moments beyond the limit. */
  beyond: number | null;
  /** Fraction of all moments that are judged. */
  judged: number | null;
  /** Fraction of the judged moments beyond the limit. */
  beyondOfJudged: number | null;
}

const share = (part: number[], whole: number[]) => (whole.length ? part.length / whole.length : null);

/** Computes how often the residual along x is beyond its limit. */
export function sharesAlongX({ x }: Trace): Shares {
  const { measured_m_s2: measured, twin_m_s2: twin, limit_m_s2: limit, enabled } = x;
  const known = measured.flatMap((value, i) => (value != null && twin[i] != null ? [i] : []));
  const isBeyond = (i: number) => Math.abs(measured[i]! - twin[i]!) >= limit[i]!;
  const judged = known.filter((i) => enabled[i]);
  return {
    beyond: share(known.filter(isBeyond), known),
    judged: share(judged, known),
    beyondOfJudged: share(judged.filter(isBeyond), judged),
  };
}
