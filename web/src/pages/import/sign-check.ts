/** Checks whether the ball of a recording accelerates in the direction of the commanded tilt. */
import { correlation, type Correlations } from "../../live/correlation";
import type { Columns } from "./columns";
import { curvature } from "./curvature";

export interface SignCheck {
  /** Correlations of the ball's acceleration along each axis with the slopes along both. */
  x: Correlations;
  y: Correlations;
}

/** Half the length of the window of a fit, s. */
const HALF_S = 0.3;

/** Usual delay of the plate angle after its command, s. */
const SERVO_DELAY_S = 0.08;

/** Default and smallest sample period, s. */
const DEFAULT_PERIOD_S = 0.01;
const MIN_PERIOD_S = 1e-4;

function mean(column: (number | null)[], from: number, to: number): number | null {
  const known = column.slice(Math.max(from, 0), to + 1).filter((value) => value !== null);
  return known.length ? known.reduce((sum, value) => sum + value, 0) / known.length : null;
}

/**
 * Correlates the curvature of the path over short windows with both commands over the same window,
 * shifted by the delay of a servo. By convention, +qy moves the ball toward +x, +qx toward −y.
 */
export function checkSigns(columns: Columns): SignCheck {
  const { t_s: t, cmd_qx_rad, cmd_qy_rad } = columns;
  const n = t.length;
  const period = n > 1 ? ((t[n - 1] ?? 0) - (t[0] ?? 0)) / (n - 1) : DEFAULT_PERIOD_S;
  const samples = (seconds: number) => Math.round(seconds / Math.max(period, MIN_PERIOD_S));
  const half = Math.max(samples(HALF_S), 3);
  const delay = samples(SERVO_DELAY_S);
  const acceleration = { x: [] as number[], y: [] as number[] };
  const slope = { x: [] as number[], y: [] as number[] };
  for (let i = half + delay; i + half < n; i += Math.max(half >> 1, 1)) {
    const x = curvature(t, columns.x_m, i - half, i + half);
    const y = curvature(t, columns.y_m, i - half, i + half);
    const qx = mean(cmd_qx_rad, i - half - delay, i + half - delay);
    const qy = mean(cmd_qy_rad, i - half - delay, i + half - delay);
    if (x === null || y === null || qx === null || qy === null) continue;
    acceleration.x.push(x);
    acceleration.y.push(y);
    slope.x.push(Math.sin(qy));
    slope.y.push(-Math.sin(qx));
  }
  return {
    x: { own: correlation(acceleration.x, slope.x), other: correlation(acceleration.x, slope.y) },
    y: { own: correlation(acceleration.y, slope.y), other: correlation(acceleration.y, slope.x) },
  };
}
