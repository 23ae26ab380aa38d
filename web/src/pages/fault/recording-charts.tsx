import { useEffect, useMemo } from "preact/hooks";
import type { Axis, FaultRecording } from "../../api/types";
import { AXES, TraceBuffer } from "../../live/buffer";
import { traceOfRecording } from "../../live/recording";
import { ChartGroup } from "../../parts/charts/chart-group";
import { RECORDED_CHARTS } from "../../parts/charts/chart-kinds";
import type { Mark } from "../../parts/charts/overlays";
import { RigCharts } from "../../parts/charts/rig-charts";

function marksOf({ onset_s, failed_s, confirmed_s }: FaultRecording): Mark[] {
  const marks: Mark[] = [];
  if (onset_s != null) marks.push({ t: onset_s, label: "onset", colour: "ink" });
  marks.push({ t: failed_s, label: "pending", colour: "warn" });
  if (confirmed_s != null) marks.push({ t: confirmed_s, label: "confirmed", colour: "bad" });
  return marks;
}

/** The charts of a recording for the axis of its fault, or for both axes. */
export function RecordingCharts({ recording, axis }: { recording: FaultRecording; axis?: Axis | null }) {
  const group = useMemo(() => new ChartGroup(), []);
  const buffer = useMemo(() => TraceBuffer.of(traceOfRecording(recording)), [recording]);
  useEffect(() => {
    if (!buffer.t.length) return;
    const { from_s, to_s, failed_s } = recording;
    group.setMarks(marksOf(recording));
    const end = Math.min(to_s, Math.max(buffer.last, failed_s + 1));
    group.draw(buffer, [Math.max(from_s, buffer.first), end]);
  }, [buffer, group, recording]);
  if (!buffer.t.length) return <p class="quiet">The recording has no data in this range.</p>;
  const axes = axis ? [axis] : [...AXES];
  return <RigCharts group={group} kinds={RECORDED_CHARTS} axes={axes} height={150} measuredOnly />;
}
