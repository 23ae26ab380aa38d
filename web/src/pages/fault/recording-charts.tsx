import { useEffect, useMemo } from "preact/hooks";
import type { FaultEntry, FaultRecording, Trace } from "../../api/types";
import { AXES, TraceBuffer } from "../../live/buffer";
import { traceOfRecording } from "../../live/recording";
import { ChartGroup } from "../../parts/charts/chart-group";
import { RECORDED_CHARTS, SESSION_CHARTS } from "../../parts/charts/chart-kinds";
import type { Mark } from "../../parts/charts/overlays";
import { RigCharts } from "../../parts/charts/rig-charts";
import { ThinnedNote } from "../../parts/charts/thinned-note";
import { ChartsOfMonitor, MonitorCharts } from "../session/monitor-charts";
import { useZoom } from "../session/use-zoom";
import { ZoomButtons } from "../session/zoom-buttons";
import type { FaultMoment } from "./use-fault-moment";

const HEIGHT = 150;

function marksOf({ onset_s, failed_s, confirmed_s }: FaultRecording): Mark[] {
  const marks: Mark[] = [];
  if (onset_s != null) marks.push({ t: onset_s, label: "onset", colour: "ink" });
  marks.push({ t: failed_s, label: "suspected", colour: "warn" });
  if (confirmed_s != null) marks.push({ t: confirmed_s, label: "confirmed", colour: "bad" });
  return marks;
}

/** The charts of a moment as a group, what they draw, and the range that was zoomed to. */
function useMomentCharts({ recording, trace }: FaultMoment) {
  const group = useMemo(() => new ChartGroup(), []);
  const buffer = useMemo(() => TraceBuffer.of(trace ?? traceOfRecording(recording)), [trace, recording]);
  const { from_s, to_s, failed_s } = recording;
  const first = Math.max(from_s, buffer.first);
  const last = Math.min(to_s, Math.max(buffer.last, failed_s + 1));
  const zoom = useZoom(first, last);
  const [from, to] = zoom.zoom ?? [first, last];
  useEffect(() => group.setMarks(marksOf(recording)), [group, recording]);
  useEffect(() => {
    if (buffer.t.length) group.draw(buffer, [from, to]);
  }, [group, buffer, from, to]);
  return { group, zoom, isEmpty: !buffer.t.length };
}

interface Props {
  moment: FaultMoment;
  fault: FaultEntry;
  /** Whether they are for paper, where nothing can be chosen. */
  isPrinted?: boolean;
}

/** The charts of the moment of a fault, for its axis or for both, with the curves on which its monitor decided. */
export function RecordingCharts({ moment, fault: { code, axis }, isPrinted }: Props) {
  const { group, zoom, isEmpty } = useMomentCharts(moment);
  if (isEmpty) return <p class="quiet">The recording has no data in this range.</p>;
  const axes = axis ? [axis] : [...AXES];
  const chart = { group, height: HEIGHT, onZoom: isPrinted ? undefined : zoom.zoomTo };
  const { trace } = moment;
  return (
    <>
      {!isPrinted && <ZoomButtons zoom={zoom} />}
      {trace ? (
        <>
          <ThinnedNote stride={trace.stride} hint="The page of the session shows all of them." />
          <RigCharts {...chart} kinds={["residual"]} axes={axes} />
          <DecisionCharts {...chart} code={code} trace={trace} isPrinted={isPrinted} />
          <RigCharts {...chart} kinds={SESSION_CHARTS} axes={axes} />
        </>
      ) : (
        <RigCharts {...chart} kinds={RECORDED_CHARTS} axes={axes} measuredOnly />
      )}
      {!isPrinted && <p class="quiet small-text">Drag over a chart to zoom in, double-click to zoom out.</p>}
    </>
  );
}

interface DecisionProps {
  group: ChartGroup;
  height: number;
  onZoom?: (range: [number, number] | undefined) => void;
  code: FaultEntry["code"];
  trace: Trace;
  isPrinted?: boolean;
}

/** Evidence and counter of the fault's monitor; on the screen, those of another one can be chosen. */
function DecisionCharts({ code, trace: { thresholds = [] }, isPrinted, ...chart }: DecisionProps) {
  if (isPrinted) return <ChartsOfMonitor {...chart} code={code} thresholds={thresholds} />;
  return <MonitorCharts {...chart} first={code} thresholds={thresholds} />;
}
