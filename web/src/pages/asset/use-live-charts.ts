import { useMemo, useRef, useState } from "preact/hooks";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import type { TraceBuffer } from "../../live/buffer";
import { PlayoutClock } from "../../live/playout-clock";
import { poseAt, type Pose } from "../../live/pose";
import type { ChartGroup } from "../../parts/charts/chart-group";

/** Charts are drawn in every second frame: they move by less than a pixel per frame. */
const CHART_EVERY = 2;

/** Duration of the path in the plan view, s. */
const TAIL_S = 4;

const LEVEL: Pose = { qx: 0, qy: 0, ball: null, ghost: null };

/** The live view of a rig: charts and drawings of the same moment, which can be paused. */
export function useLiveCharts(buffer: TraceBuffer, group: ChartGroup) {
  const playout = useMemo(() => new PlayoutClock(), []);
  const [span, setSpan] = useState<number>(10);
  const [isPaused, setPaused] = useState(false);
  const shown = useRef(0);
  const frame = useRef(0);
  useAnimationFrame((now) => {
    if (!buffer.t.length) return;
    const t = playout.tick(now, buffer.last);
    if (isPaused) return;
    shown.current = t;
    if (frame.current++ % CHART_EVERY === 0) group.draw(buffer, [t - span, t]);
  });
  const pose = () => (buffer.t.length ? poseAt(buffer, shown.current) : LEVEL);
  const moment = () => ({ buffer, t: shown.current, tail: TAIL_S });
  return { group, span, setSpan, isPaused, setPaused, pose, moment };
}

export type LiveCharts = ReturnType<typeof useLiveCharts>;
