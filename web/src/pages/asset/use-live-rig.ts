import { useMemo, useRef } from "preact/hooks";
import { useNow } from "../../hooks/use-now";
import { useRigStream } from "../../hooks/use-rig-stream";
import { ChartGroup } from "../../parts/charts/chart-group";
import { faultMark } from "../../parts/charts/fault-marks";
import type { Mark } from "../../parts/charts/overlays";
import { useLiveCharts } from "./use-live-charts";

/** States a second; the trace that comes with each has every judged sample. */
const STATES_PER_SECOND = 20;

/** Texts that change more often cannot be read, ms. */
const RENDER_MS = 150;

/** A rig that has sent nothing for so long is silent, ms. */
const SILENT_MS = 10_000;

/** The rig as it happens, and the charts of it, in which its faults are marked. */
export function useLiveRig(name: string, faultChanged: () => void) {
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
      faultChanged();
      setMarks([...marks.current, faultMark(line)]);
    },
  });
  const charts = useLiveCharts(buffer, group);
  const now = useNow(500);
  return { state, connection, isSilent: isSilent(now, SILENT_MS), charts };
}
