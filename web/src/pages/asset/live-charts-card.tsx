import { ALL_CHARTS } from "../../parts/charts/chart-kinds";
import { RigCharts } from "../../parts/charts/rig-charts";
import type { LiveCharts } from "./use-live-charts";

/** Selectable time spans of the charts, s. */
const SPANS = [10, 30, 60];

/** Part of the shown range by which a button moves it. */
const STEP = 0.5;

export function LiveChartsCard({ charts }: { charts: LiveCharts }) {
  const { group, span, setSpan, isPaused, toggle, pan, zoomTo, seek } = charts;
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
          {isPaused && (
            <>
              <button type="button" class="small" aria-label="Earlier" onClick={() => pan(-STEP)}>
                ◀
              </button>
              <button type="button" class="small" aria-label="Later" onClick={() => pan(STEP)}>
                ▶
              </button>
            </>
          )}
          <button type="button" class="small" aria-pressed={isPaused} onClick={toggle}>
            {isPaused ? "▶ resume" : "❚❚ pause"}
          </button>
        </div>
      </div>
      <RigCharts group={group} kinds={ALL_CHARTS} height={136} onZoom={zoomTo} onSeek={seek} />
      <p class="quiet small-text">
        Time on the device's clock, s. The band around the residual is its limit. The residual is judged only
        where the background is shaded: while the servo is under test. Drag over a chart to pause and zoom in,
        double-click to go on.
      </p>
    </section>
  );
}
