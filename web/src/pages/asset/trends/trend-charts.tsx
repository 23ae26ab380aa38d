import type { Trends } from "../../../api/types";
import { TrendChart } from "./trend-chart";

/** A chart for each parameter that is followed, or why there is none. */
export function TrendCharts({ trends: { trends, points, calibration_id } }: { trends: Trends }) {
  if (!calibration_id) return <p class="quiet">Nothing is followed until the rig has been learnt.</p>;
  const estimated = points.filter((point) => point.calibration_id === calibration_id);
  if (!trends.length)
    return (
      <p class="quiet">
        {estimated.length} of 7 sessions that it takes have been estimated since the rig was learnt; each
        needs twenty seconds in which the ball moves. A session counts once it has ended.
      </p>
    );
  return (
    <>
      <p class="quiet small-text">
        One dot for each session since the rig was learnt, oldest on the left. A line that surely leads beyond
        a limit (dashed) within 20 sessions is warned of. Compare like with like: another motion may move the
        dots too.
      </p>
      <div class="trends">
        {trends.map((trend) => (
          <TrendChart trend={trend} points={estimated} />
        ))}
      </div>
    </>
  );
}
