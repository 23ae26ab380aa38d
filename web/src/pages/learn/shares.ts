import type { Trace } from "../../api/types";

export interface Shares {
  /** Of all moments, those beyond the limit. */
  beyond: number | null;
  /** Of all moments, those that are judged. */
  judged: number | null;
  /** Of the judged moments, those beyond the limit. */
  beyondOfJudged: number | null;
}

const share = (part: number[], whole: number[]) => (whole.length ? part.length / whole.length : null);

/** How often the ball's acceleration along x is beyond the limit. */
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
