import { useMemo, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset, Axis, FaultLine, Session, Thresholds } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { useSeen } from "../../hooks/use-seen";
import { AXES, type TraceBuffer } from "../../live/buffer";
import { judgedMarks } from "./judged-marks";
import { PlaybackTop } from "./playback-top";
import { PlayerCard } from "./player-card";
import type { ProfileOrRecorded } from "./profile-choice";
import { remarkMarks } from "./remarks";
import { RemarksCard } from "./remarks-card";
import type { TriedSettings } from "./trial";
import { TrialCard } from "./trial-card";
import { useDetail } from "./use-detail";
import { useHotkeys } from "./use-hotkeys";
import { usePlayback } from "./use-playback";
import { usePlaybackCharts } from "./use-playback-charts";
import { useTrial } from "./use-trial";

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
  const { ref: trialCard, isSeen } = useSeen<HTMLElement>();
  const isWanted = isSeen || profile !== "";
  const trial = useTrial({ session: session.id, profile, settings: tried, isWanted });
  const remarks = useQuery(() => api.remarks(session.id), `${session.id} remarks`);
  const marks = useMemo(() => {
    const judged = judgedMarks({ faults, profile, tried, trial: trial.trial });
    return [...judged, ...remarkMarks(remarks.data ?? [])];
  }, [faults, profile, tried, trial.trial, remarks.data]);
  const charts = usePlaybackCharts({ buffer, stride, detail, marks, playback });
  useHotkeys(playback);
  if (!buffer?.t.length) return null;
  return (
    <>
      <UnseenNote axes={unseenAxes(buffer)} />
      <PlaybackTop
        session={session}
        asset={asset}
        faults={faults}
        buffer={buffer}
        playback={playback}
        charts={charts}
      />
      <PlayerCard
        buffer={buffer}
        thresholds={thresholds}
        stride={stride}
        playback={playback}
        charts={charts}
        profile={profile}
        setProfile={setProfile}
      />
      <RemarksCard session={session.id} remarks={remarks} playback={playback} zoom={charts.zoom} />
      <TrialCard thresholds={thresholds} settings={tried} choose={setTried} state={trial} card={trialCard} />
    </>
  );
}
