import { ALL_CHARTS } from "../../parts/charts/chart-kinds";
import { RigCharts } from "../../parts/charts/rig-charts";
import type { LiveCharts } from "./use-live-charts";

/** Seconds that the charts can show. */
const SPANS = [10, 30, 60];

export function LiveChartsCard({ charts }: { charts: LiveCharts }) {
  const { group, span, setSpan, isHeld, setHeld } = charts;
  return (
    <section class="card">
      <div class="card-head">
        <h2>Rig and twin</h2>
        <div class="chips" role="group" aria-label="Time shown">
          {SPANS.map((s) => (
            <button type="button" class="small" aria-pressed={span === s} onClick={() => setSpan(s)}>
              {s} s
            </button>
          ))}
          <button type="button" class="small" aria-pressed={isHeld} onClick={() => setHeld(!isHeld)}>
            {isHeld ? "▶ go on" : "❚❚ hold"}
          </button>
        </div>
      </div>
      <RigCharts group={group} kinds={ALL_CHARTS} height={136} />
      <p class="quiet small-text">
        Time on the device's clock, s. The residual counts only while the ground is tinted (the gate is open);
        the band is the limit.
      </p>
    </section>
  );
}
