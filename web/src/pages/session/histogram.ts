/** How often each residual occurs among the judged moments of a range. */
import type { Axis } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";

/** Number of bins; odd, so that zero is in the middle of one. */
const BINS = 41;

/** Smallest extent of the histogram on either side of zero, as a multiple of the limit. */
const LEAST_EXTENT = 1.25;

export interface Histogram {
  /** Number of moments in each bin, from −extent to extent. */
  counts: number[];
  /** m/s². */
  extent: number;
  /** Judged moments. */
  n: number;
  /** Judged moments whose residual is at or beyond the limit in force then. */
  nBeyond: number;
  /** The median of the limits, m/s². */
  limit: number;
}

interface JudgedMoment {
  residual: number;
  limit: number;
}

function judgedMoments(buffer: TraceBuffer, axis: Axis, [from, to]: [number, number]): JudgedMoment[] {
  const { residual, limit, enabled } = buffer[axis];
  return buffer.t.flatMap((t, i) => {
    const [r, l] = [residual[i], limit[i]];
    return t >= from && t <= to && enabled[i] && r != null && l != null ? [{ residual: r, limit: l }] : [];
  });
}

/** Returns the bin of a value. */
export const binOf = (value: number, extent: number) =>
  Math.min(Math.max(Math.floor(((value + extent) / (2 * extent)) * BINS), 0), BINS - 1);

/** Returns the histogram of the residual in `range`; undefined if nothing was judged there. */
export function residualHistogram(
  buffer: TraceBuffer,
  axis: Axis,
  range: [number, number],
): Histogram | undefined {
  const judged = judgedMoments(buffer, axis, range);
  if (!judged.length) return undefined;
  const limits = judged.map(({ limit }) => limit).sort((a, b) => a - b);
  const limit = limits[limits.length >> 1]!;
  const extent = judged.reduce(
    (most, { residual }) => Math.max(most, Math.abs(residual)),
    LEAST_EXTENT * limit,
  );
  const counts = Array<number>(BINS).fill(0);
  for (const { residual } of judged) counts[binOf(residual, extent)]!++;
  const nBeyond = judged.filter((moment) => Math.abs(moment.residual) >= moment.limit).length;
  return { counts, extent, n: judged.length, nBeyond, limit };
}
