import { ALL_CHARTS } from "../../parts/charts/chart-kinds";
import { RigCharts } from "../../parts/charts/rig-charts";
import { Term } from "../../parts/term";
import { seconds } from "../../words/numbers";
import { dateTime } from "../../words/time";
import type { LiveCharts } from "./use-live-charts";

/** Selectable time spans of the charts, s. */
const SPANS = [10, 30, 60];

/** Part of the shown range by which a button moves it. */
const STEP = 0.5;

/** The last sample of a session of which the page has received nothing to draw. */
interface LastSample {
  /** Its time, s on the device's clock; missing if none has been judged. */
  t_s?: number | null;
  /** When it arrived, if that is known. */
  at?: string | null;
}

/** Says that there is nothing to draw, and when the last sample was. */
function NothingDrawn({ last: { t_s, at } }: { last: LastSample }) {
  const when = t_s != null && `The last sample was at ${seconds(t_s)} on the device's clock`;
  return (
    <p class="note">
      <b>No data in the last seconds.</b> {when && `${when}${at ? `, received ${dateTime(at)}` : ""}. `}
      Samples are drawn here as they arrive; what was recorded is on the page of the session.
    </p>
  );
}

interface Props {
  charts: LiveCharts;
  /** Set if there is nothing to draw. */
  still?: LastSample;
}

export function LiveChartsCard({ charts, still }: Props) {
  const { span, setSpan, isPaused, toggle, pan } = charts;
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
      {still && <NothingDrawn last={still} />}
      {!still && <DrawnCharts charts={charts} />}
    </section>
  );
}

function DrawnCharts({ charts: { group, zoomTo, seek } }: { charts: LiveCharts }) {
  return (
    <>
      <RigCharts group={group} kinds={ALL_CHARTS} height={136} onZoom={zoomTo} onSeek={seek} />
      <p class="quiet small-text">
        Time on the device's clock, s. The band around the residual is its limit. The residual is judged only
        where the background is <Term of="enabled">shaded</Term>. Drag over a chart to pause and zoom in,
        double-click to go on.
      </p>
    </>
  );
}
