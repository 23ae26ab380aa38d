import type { Asset, FaultLine, Session } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";
import { poseAt } from "../../live/pose";
import { RigView } from "../../parts/rig-view/rig-view";
import { XyTrace } from "../../parts/xy-trace/xy-trace";
import { FoundCard } from "./found-card";
import { PlayerCard } from "./player-card";
import type { ProfileOrRecorded } from "./profile-choice";
import { useHotkeys } from "./use-hotkeys";
import { usePlayback } from "./use-playback";
import { usePlaybackCharts } from "./use-playback-charts";

/** Duration of the path in the plan view, s. */
const TAIL_S = 4;

interface Props {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
  /** Undefined while it is fetched; the player keeps its current time. */
  buffer?: TraceBuffer;
  profile: ProfileOrRecorded;
  setProfile: (profile: ProfileOrRecorded) => void;
}

/** The playback of a recording: drawings and charts of the same moment. */
export function Player({ session, asset, faults, buffer, profile, setProfile }: Props) {
  const playback = usePlayback(buffer);
  const charts = usePlaybackCharts(buffer, faults, playback);
  useHotkeys(playback);
  if (!buffer?.t.length) return null;
  const { t, seek } = playback;
  return (
    <>
      <div class="live-top">
        <RigView
          asset={asset}
          pose={() => poseAt(buffer, t.current)}
          name={`${session.asset}-${session.name}`}
        />
        <div class="live-side">
          <section class="card">
            <h2>From above</h2>
            <XyTrace asset={asset} moment={() => ({ buffer, t: t.current, tail: TAIL_S })} />
          </section>
          <FoundCard session={session} faults={faults} seek={seek} />
        </div>
      </div>
      <PlayerCard
        buffer={buffer}
        playback={playback}
        charts={charts}
        profile={profile}
        setProfile={setProfile}
      />
    </>
  );
}
