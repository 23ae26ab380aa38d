import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { FaultLine } from "../../api/types";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import type { TraceBuffer } from "../../live/buffer";
import { ChartGroup } from "../../parts/charts/chart-group";
import { faultMark } from "../../parts/charts/fault-marks";
import { seconds } from "../../words/numbers";
import type { Playback } from "./use-playback";
import { visibleRange } from "./visible-range";

/** Charts are drawn in every second frame: they move by less than a pixel per frame. */
const CHART_EVERY = 2;

/** The charts, the slider and the clock of the playback, updated without rendering components. */
export function usePlaybackCharts(buffer: TraceBuffer | undefined, faults: FaultLine[], { t }: Playback) {
  const group = useMemo(() => new ChartGroup(), []);
  /** Time span of the charts, s; 0 for the whole recording. */
  const [span, setSpan] = useState<number>(30);
  const slider = useRef<HTMLInputElement>(null);
  const clock = useRef<HTMLOutputElement>(null);
  const drawn = useRef("");
  const frame = useRef(0);
  useEffect(() => group.setMarks(faults.map(faultMark)), [group, faults]);
  useEffect(() => {
    // A new buffer is drawn even if the time is the same.
    drawn.current = "";
  }, [buffer]);
  useAnimationFrame(() => {
    if (!buffer?.t.length) return;
    const key = `${t.current.toFixed(3)} ${span}`;
    if (key === drawn.current || frame.current++ % CHART_EVERY) return;
    drawn.current = key;
    group.draw(buffer, visibleRange(t.current, span, buffer.first, buffer.last), t.current);
    if (slider.current) {
      slider.current.value = String(t.current);
      slider.current.setAttribute("aria-valuetext", seconds(t.current));
    }
    if (clock.current) clock.current.textContent = `${t.current.toFixed(2)} s`;
  });
  return { group, span, setSpan, slider, clock };
}

export type PlaybackCharts = ReturnType<typeof usePlaybackCharts>;
