import { useEffect, useMemo } from "preact/hooks";
import type { Profile, Session, Trace } from "../../api/types";
import { TraceBuffer } from "../../live/buffer";
import { ChartGroup } from "../../parts/charts/chart-group";
import { RigCharts } from "../../parts/charts/rig-charts";
import { JudgedFacts } from "./judged-facts";

interface Props {
  session: Session;
  profile: Profile;
  trace?: Trace;
  /** The largest value of the compared charts, so that they have the same scale. */
  extent: number;
}

/** A stretch of a session judged with one profile. */
export function JudgedByProfile({ session, profile, trace, extent }: Props) {
  const group = useMemo(() => new ChartGroup(), []);
  useEffect(() => {
    if (!trace) return;
    const buffer = TraceBuffer.of(trace);
    if (buffer.t.length) group.draw(buffer, [buffer.first, buffer.last]);
  }, [group, trace, extent]);
  return (
    <div>
      <h3>{profile}</h3>
      <RigCharts group={group} kinds={["residual"]} axes={["x"]} height={170} minExtent={extent} />
      <JudgedFacts session={session} profile={profile} trace={trace} />
    </div>
  );
}
