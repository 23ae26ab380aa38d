/** How well a calibration fits a recording. */
import type { Axis, Trace } from "../../api/types";
import { number } from "../../words/numbers";

/** The root mean square of the residual while it could be judged, m/s²; null if it never could. */
export function residualRms(trace: Pick<Trace, Axis>, axis: Axis): number | null {
  const columns = trace[axis];
  const residuals = columns.measured_m_s2.flatMap((measured, i) => {
    const twin = columns.twin_m_s2[i];
    return columns.enabled[i] && measured != null && twin != null ? [measured - twin] : [];
  });
  if (!residuals.length) return null;
  return Math.sqrt(residuals.reduce((sum, residual) => sum + residual * residual, 0) / residuals.length);
}

const size = (rms: number) => number(rms, 3, "m/s²");

/** The residual along an axis with two calibrations in words. */
export function fitSentence(axis: Axis, before: number | null, after: number | null): string {
  if (after === null) return `Along ${axis} the residual could not be judged.`;
  const now = `Along ${axis} the residual is ${size(after)} (root mean square)`;
  if (before === null) return `${now}; with the other calibration it could not be judged.`;
  const change = before > 0 ? Math.round((after / before - 1) * 100) : 0;
  if (change === 0) return `${now}, the same as before.`;
  return `${now}, ${Math.abs(change)} % ${change < 0 ? "less" : "more"} than the ${size(before)} before.`;
}
