import { useMemo, useRef } from "preact/hooks";
import { useNow } from "../../hooks/use-now";
import { useRigStream } from "../../hooks/use-rig-stream";
import { ChartGroup } from "../../parts/charts/chart-group";
import { faultMark } from "../../parts/charts/fault-marks";
import type { Mark } from "../../parts/charts/overlays";
import { useLiveCharts } from "./use-live-charts";

/** States per second; the trace of each has every judged sample. */
const STATES_PER_SECOND = 20;

/** Shortest interval between two renderings, so that the text is readable, ms. */
const RENDER_MS = 150;

/** Time without a sample after which a rig counts as silent, ms. */
const SILENT_MS = 10_000;

/** Time without a sample after which the page says that empty charts have nothing to show, ms. */
const STILL_MS = 3000;

/** The live state of the rig, and its charts with marks at the faults. */
export function useLiveRig(name: string, changed: () => void) {
  const group = useMemo(() => new ChartGroup(), []);
  const marks = useRef<Mark[]>([]);
  const setMarks = (next: Mark[]) => {
    marks.current = next;
    group.setMarks(next);
  };
  const { state, buffer, connection, isSilent } = useRigStream(name, {
    statesPerSecond: STATES_PER_SECOND,
    renderInterval: RENDER_MS,
    newSession: () => setMarks([]),
    fault: (line) => {
      changed();
      setMarks([...marks.current, faultMark(line)]);
    },
    communication: changed,
  });
  const charts = useLiveCharts(buffer, group);
  const now = useNow(500);
  /** Whether there is nothing to draw: the samples of the session came before the page was opened. */
  const isStill = state !== undefined && buffer.t.length === 0 && isSilent(now, STILL_MS);
  return { state, connection, isSilent: isSilent(now, SILENT_MS), isStill, charts };
}
