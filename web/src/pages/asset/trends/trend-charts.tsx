import type { Trends } from "../../../api/types";
import { TrendChart } from "./trend-chart";

/** A chart for each tracked parameter, or the reason why there is none. */
export function TrendCharts({ trends: { trends, points, calibration_id } }: { trends: Trends }) {
  if (!calibration_id) return <p class="quiet">There are no trends before the rig is calibrated.</p>;
  const estimated = points.filter((point) => point.calibration_id === calibration_id);
  if (!trends.length)
    return (
      <p class="quiet">
        {estimated.length} of 6 sessions so far. A session counts if the ball moves for 10 s of it, once it
        has ended.
      </p>
    );
  return (
    <>
      <p class="quiet small-text">
        One dot per session since the calibration, oldest on the left. The page warns of a significant trend
        that reaches a limit (dashed) within 20 sessions. Compare sessions with similar motion: a different
        motion may shift the estimates too.
      </p>
      <div class="trends">
        {trends.map((trend) => (
          <TrendChart trend={trend} points={estimated} />
        ))}
      </div>
    </>
  );
}
