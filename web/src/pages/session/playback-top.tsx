import type { Asset, FaultLine, Session } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";
import { poseAt } from "../../live/pose";
import { RigView } from "../../parts/rig-view/rig-view";
import { XyTrace } from "../../parts/xy-trace/xy-trace";
import { FoundCard } from "./found-card";
import type { Playback } from "./use-playback";
import type { PlaybackCharts } from "./use-playback-charts";

/** Duration of the path in the plan view, s. */
const TAIL_S = 4;

interface Props {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
  buffer: TraceBuffer;
  playback: Playback;
  charts: PlaybackCharts;
}

/** The drawings of the current moment, and the verdict. */
export function PlaybackTop({ session, asset, faults, buffer, playback: { t, seek }, charts }: Props) {
  const { drawnBuffer } = charts;
  return (
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
  );
}
