import { useMemo, useState } from "preact/hooks";
import type { Asset, Axis, FaultLine, Session, Thresholds } from "../../api/types";
import { AXES, type TraceBuffer } from "../../live/buffer";
import { poseAt } from "../../live/pose";
import { faultMark } from "../../parts/charts/fault-marks";
import { RigView } from "../../parts/rig-view/rig-view";
import { XyTrace } from "../../parts/xy-trace/xy-trace";
import { FoundCard } from "./found-card";
import { PlayerCard } from "./player-card";
import type { ProfileOrRecorded } from "./profile-choice";
import { alarmMarks, type TriedSettings } from "./trial";
import { TrialCard } from "./trial-card";
import { useDetail } from "./use-detail";
import { useHotkeys } from "./use-hotkeys";
import { usePlayback } from "./use-playback";
import { usePlaybackCharts } from "./use-playback-charts";
import { useTrial } from "./use-trial";

/** Duration of the path in the plan view, s. */
const TAIL_S = 4;

interface Props {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
  /** Undefined while it is fetched; the player keeps its current time. */
  buffer?: TraceBuffer;
  /** The values at which the monitors decide. */
  thresholds: Thresholds[];
  /** Every how many judged moments the buffer has one. */
  stride: number;
  /** Most moments of a trace. */
  points: number;
  profile: ProfileOrRecorded;
  setProfile: (profile: ProfileOrRecorded) => void;
}

/** The axes along which the recording has no position at all. */
const unseenAxes = (buffer: TraceBuffer) =>
  AXES.filter((axis) => buffer[axis].position.every((value) => value === null));

function UnseenNote({ axes }: { axes: Axis[] }) {
  if (!axes.length) return null;
  return (
    <p class="note">
      The recording has no position along {axes.join(" and ")}, so the ball cannot be drawn on the plate. The
      charts show what there is.
    </p>
  );
}

/** The playback of a recording: drawings and charts of the same moment. */
export function Player(props: Props) {
  const { session, asset, faults, buffer, thresholds, stride, points, profile, setProfile } = props;
  const playback = usePlayback(buffer);
  const detail = useDetail(session, profile, buffer, stride, points);
  const [tried, setTried] = useState<TriedSettings>({});
  const trial = useTrial(session.id, profile, tried);
  const marks = useMemo(
    () => [...faults.map(faultMark), ...alarmMarks(trial.trial?.monitors ?? [])],
    [faults, trial],
  );
  const charts = usePlaybackCharts({ buffer, detail, marks, playback });
  useHotkeys(playback);
  if (!buffer?.t.length) return null;
  const { t, seek } = playback;
  const { drawnBuffer } = charts;
  return (
    <>
      <UnseenNote axes={unseenAxes(buffer)} />
      <div class="playback-top">
        <RigView
          asset={asset}
          pose={() => poseAt(drawnBuffer() ?? buffer, t.current)}
          name={`${session.asset}-${session.name}`}
        />
        <section class="card">
          <h2>From above</h2>
          <XyTrace
            asset={asset}
            moment={() => ({ buffer: drawnBuffer() ?? buffer, t: t.current, tail: TAIL_S })}
          />
        </section>
        <FoundCard session={session} asset={asset} faults={faults} seek={seek} />
      </div>
      <PlayerCard
        buffer={buffer}
        thresholds={thresholds}
        stride={stride}
        playback={playback}
        charts={charts}
        profile={profile}
        setProfile={setProfile}
      />
      <TrialCard thresholds={thresholds} settings={tried} choose={setTried} state={trial} />
    </>
  );
}
