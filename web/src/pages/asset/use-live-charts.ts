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

type Range = [from: number, to: number];

/**
 * The live view of a rig: charts and drawings of the same moment. It can be paused, and then looked back over
 * all that the page has received.
 */
export function useLiveCharts(buffer: TraceBuffer, group: ChartGroup) {
  const playout = useMemo(() => new PlayoutClock(), []);
  const [span, setSpan] = useState<number>(10);
  /** The shown range while the view is paused. */
  const [held, setHeld] = useState<Range>();
  const shown = useRef(0);
  const frame = useRef(0);
  useAnimationFrame((now) => {
    if (!buffer.t.length) return;
    const t = playout.tick(now, buffer.last);
    if (!held) shown.current = t;
    if (frame.current++ % CHART_EVERY === 0) group.draw(buffer, held ?? [t - span, t], held && shown.current);
  });
  const hold = (range: Range) => {
    setHeld(range);
    shown.current = Math.min(Math.max(shown.current, range[0]), range[1]);
  };
  /** Moves the held range by a share of its length, within what is there. */
  const pan = (share: number) => {
    if (!held) return;
    const length = held[1] - held[0];
    const from = Math.min(Math.max(held[0] + share * length, buffer.first), buffer.last - length);
    hold([from, from + length]);
  };
  const chooseSpan = (next: number) => {
    setSpan(next);
    if (held) hold([held[1] - next, held[1]]);
  };
  const toggle = () => (held ? setHeld(undefined) : hold([shown.current - span, shown.current]));
  const pose = () => (buffer.t.length ? poseAt(buffer, shown.current) : LEVEL);
  const moment = () => ({ buffer, t: shown.current, tail: TAIL_S });
  return {
    group,
    span,
    setSpan: chooseSpan,
    isPaused: held !== undefined,
    toggle,
    pan,
    /** Pauses at the range over which the pointer was dragged; goes on after a double click. */
    zoomTo: (range: Range | undefined) => (range ? hold(range) : setHeld(undefined)),
    seek: (t: number) => {
      if (held) shown.current = t;
    },
    pose,
    moment,
  };
}

export type LiveCharts = ReturnType<typeof useLiveCharts>;
