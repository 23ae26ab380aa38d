import type { Trend, TrendPoint } from "../../../api/types";
import { estimates, isSignificant, parameterOf, parameterText } from "./parameters";

const WIDTH = 300;
const HEIGHT = 110;
/** Horizontal and vertical margins. */
const MARGIN_X = 8;
const MARGIN_Y = 6;

/** Returns the scales from sessions and values to points of the plot. */
function scales(trend: Trend, values: (number | null)[]) {
  const known = values.filter((value) => value !== null);
  const low = Math.min(trend.limit_low, ...known);
  const high = Math.max(trend.limit_high, ...known);
  const margin = (high - low) * 0.06;
  const last = Math.max(values.length - 1, 1);
  return {
    x: (i: number) => MARGIN_X + (WIDTH - 2 * MARGIN_X) * (i / last),
    y: (value: number) =>
      MARGIN_Y + (HEIGHT - 2 * MARGIN_Y) * (1 - (value - low + margin) / (high - low + 2 * margin)),
  };
}

/** A dot for each session, the fitted line if it is significant, and the limits. */
export function TrendPlot({ trend, points, label }: { trend: Trend; points: TrendPoint[]; label: string }) {
  const parameter = parameterOf(trend);
  const values = estimates(trend, points);
  const { x, y } = scales(trend, values);
  const last = values.length - 1;
  const fitted = (i: number) => trend.level + trend.slope * (i - last);
  return (
    <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={label}>
      <title>{parameter.about}</title>
      {[trend.limit_low, trend.limit_high].map((limit) => (
        <line class="limit" x1={0} x2={WIDTH} y1={y(limit)} y2={y(limit)} />
      ))}
      <line class="nominal" x1={0} x2={WIDTH} y1={y(trend.nominal)} y2={y(trend.nominal)} />
      {isSignificant(trend) && (
        <line class="slope" x1={x(0)} x2={x(last)} y1={y(fitted(0))} y2={y(fitted(last))} />
      )}
      {values.map(
        (value, i) =>
          value !== null && (
            <circle cx={x(i)} cy={y(value)} r={3}>
              <title>
                {points[i]!.session}: {parameterText(parameter, value, 1)}
              </title>
            </circle>
          ),
      )}
    </svg>
  );
}
