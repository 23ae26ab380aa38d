import { useEffect, useMemo } from "preact/hooks";
import type { Axis } from "../../api/types";
import { TraceBuffer } from "../../live/buffer";
import type { ChartGroup } from "../../parts/charts/chart-group";
import type { ChartKindName } from "../../parts/charts/chart-kinds";
import { RigCharts } from "../../parts/charts/rig-charts";
import { ThinnedNote } from "../../parts/charts/thinned-note";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { alignedMarks, alignedTrace } from "./align";
import type { Recording } from "./use-recording";

interface Props {
  /** Draws the charts. */
  group: ChartGroup;
  recording: Recording;
  /** Where its first moment is on the common time axis, s. */
  start: number;
  range: [number, number];
  axis: Axis;
  kinds: ChartKindName[];
  onZoom: (range: [number, number] | undefined) => void;
}

/** The charts of one of the compared recordings, on the common time axis. */
export function ComparedCharts({ group, recording, start, range, axis, kinds, onZoom }: Props) {
  const { session, faults, trace } = recording;
  const buffer = useMemo(() => TraceBuffer.of(alignedTrace(trace, start)), [trace, start]);
  useEffect(
    () => group.setMarks(alignedMarks(faults, trace.t_s[0] ?? 0, start)),
    [group, faults, trace, start],
  );
  useEffect(() => group.draw(buffer, range), [group, buffer, range]);
  return (
    <section class="card">
      <h2>
        <Link to={sessionPath(session.id)}>{session.name}</Link>
      </h2>
      <p class="quiet">{session.asset}</p>
      <ThinnedNote stride={trace.stride} hint="The page of the session shows all of them." />
      <RigCharts group={group} kinds={kinds} axes={[axis]} height={130} onZoom={onZoom} />
    </section>
  );
}
