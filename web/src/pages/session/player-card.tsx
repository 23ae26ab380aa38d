import type { Thresholds } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";
import { SESSION_CHARTS } from "../../parts/charts/chart-kinds";
import { RigCharts } from "../../parts/charts/rig-charts";
import { Choice } from "../../parts/choice";
import { SPEEDS } from "./address";
import { MonitorCharts } from "./monitor-charts";
import { ProfileChoice, type ProfileOrRecorded } from "./profile-choice";
import { ResidualHistograms } from "./residual-histograms";
import type { Playback } from "./use-playback";
import type { PlaybackCharts } from "./use-playback-charts";
import { ZoomButtons } from "./zoom-buttons";

/** Selectable time spans of the charts, s; 0 for the whole recording. */
const SPANS = [
  [10, "10 s"],
  [30, "30 s"],
  [60, "60 s"],
  [0, "all"],
] as const;

const SPEED_OPTIONS = SPEEDS.map((speed) => [speed, `${speed}×`] as const);

/** Height of a chart, px. */
const HEIGHT = 136;

interface Props {
  buffer: TraceBuffer;
  /** The values at which the monitors decide. */
  thresholds: Thresholds[];
  /** Every how many judged moments the trace of the whole has one. */
  stride: number;
  playback: Playback;
  charts: PlaybackCharts;
  profile: ProfileOrRecorded;
  setProfile: (profile: ProfileOrRecorded) => void;
}

/** The charts and the controls of the playback. */
export function PlayerCard(props: Props) {
  const { buffer, thresholds, stride, playback, charts, profile, setProfile } = props;
  const { isPlaying, toggle, seek, speed, setSpeed } = playback;
  const { group, span, setSpan, slider, clock, resolution, zoomTo } = charts;
  const chart = { group, height: HEIGHT, onSeek: seek, onZoom: zoomTo };
  return (
    <section class="card">
      <div class="player">
        <button type="button" class="primary play" onClick={toggle} aria-label={isPlaying ? "Pause" : "Play"}>
          {isPlaying ? "❚❚" : "▶"}
        </button>
        <input
          ref={slider}
          type="range"
          class="scrub"
          min={buffer.first}
          max={buffer.last}
          step={0.01}
          aria-label="Moment"
          onInput={(e) => seek(Number(e.currentTarget.value))}
        />
        <output ref={clock} class="n clock" />
        <Choice isInline label="Speed" options={SPEED_OPTIONS} value={speed} change={setSpeed} />
        <Choice<number> isInline label="Show" options={SPANS} value={span} change={setSpan} />
        <ProfileChoice label="Judged by" isInline chosen={profile} choose={setProfile} />
        <ZoomButtons zoom={charts} />
      </div>
      {stride > 1 && (
        <p ref={resolution} class="resolution small-text" data-resolution="thinned">
          <span class="if-thinned late">
            Thinned: one of {stride} judged moments is drawn. Show less time to see all of them.
          </span>
          <span class="if-full quiet">Every judged moment is drawn.</span>
        </p>
      )}
      <RigCharts {...chart} kinds={["residual"]} />
      <MonitorCharts {...chart} thresholds={thresholds} />
      <RigCharts {...chart} kinds={SESSION_CHARTS} />
      <ResidualHistograms shown={charts.shown} />
      <p class="quiet small-text">
        Click a chart to go to that time; drag over it to zoom in, double-click to zoom out. Space plays or
        pauses, the arrow keys step by one second.
      </p>
    </section>
  );
}
