import type { TraceBuffer } from "../../live/buffer";
import { ALL_CHARTS } from "../../parts/charts/chart-kinds";
import { RigCharts } from "../../parts/charts/rig-charts";
import { NumberChoice } from "./number-choice";
import { ProfileChoice, type ProfileOrRecorded } from "./profile-choice";
import type { Playback } from "./use-playback";
import type { PlaybackCharts } from "./use-playback-charts";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];
/** Selectable time spans of the charts, s; 0 for the whole recording. */
const SPANS = [10, 30, 60, 0];

interface Props {
  buffer: TraceBuffer;
  playback: Playback;
  charts: PlaybackCharts;
  profile: ProfileOrRecorded;
  setProfile: (profile: ProfileOrRecorded) => void;
}

/** The charts and the controls of the playback. */
export function PlayerCard({ buffer, playback, charts, profile, setProfile }: Props) {
  const { isPlaying, toggle, seek, speed, setSpeed } = playback;
  const { group, span, setSpan, slider, clock } = charts;
  const spanText = (seconds: number) => (seconds ? `${seconds} s` : "all");
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
        <NumberChoice label="Speed" values={SPEEDS} text={(s) => `${s}×`} chosen={speed} choose={setSpeed} />
        <NumberChoice label="Show" values={SPANS} text={spanText} chosen={span} choose={setSpan} />
        <ProfileChoice label="Judged by" class="inline" chosen={profile} choose={setProfile} />
      </div>
      <RigCharts group={group} kinds={ALL_CHARTS} height={136} onSeek={seek} />
      <p class="quiet small-text">
        Click a chart to go to that time. Space plays or pauses, the arrow keys step by one second.
      </p>
    </section>
  );
}
