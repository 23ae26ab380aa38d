import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import type { TraceBuffer } from "../../live/buffer";
import { ChartGroup } from "../../parts/charts/chart-group";
import type { Mark } from "../../parts/charts/overlays";
import { seconds } from "../../words/numbers";
import type { Shown } from "./use-shown";
import type { DetailLoader } from "./use-detail";
import type { Playback } from "./use-playback";
import { useZoom } from "./use-zoom";
import { visibleRange } from "./visible-range";

/** Charts are drawn in every second frame: they move by less than a pixel per frame. */
const CHART_EVERY = 2;

interface Options {
  /** The trace of the whole recording; undefined while it is fetched. */
  buffer?: TraceBuffer;
  /** Every how many judged moments it has one. */
  stride: number;
  /** The loader of parts with every sample, if `buffer` is thinned. */
  detail?: DetailLoader;
  /** Moments that are marked in all charts. */
  marks: Mark[];
  playback: Playback;
}

function showTime(t: number, slider: HTMLInputElement | null, clock: HTMLOutputElement | null): void {
  if (slider) {
    slider.value = String(t);
    slider.setAttribute("aria-valuetext", seconds(t));
  }
  if (clock) clock.textContent = `${t.toFixed(2)} s`;
}

/** The charts, the slider and the clock of the playback, updated without rendering components. */
export function usePlaybackCharts({ buffer, stride, detail, marks, playback: { t } }: Options) {
  const group = useMemo(() => new ChartGroup(), []);
  /** Time span of the charts, s; 0 for the whole recording. */
  const [span, setSpan] = useState<number>(30);
  const first = buffer?.first ?? 0;
  const last = buffer?.last ?? 0;
  /** The range that was zoomed to, instead of one around the current time. */
  const { zoom, zoomTo, pan } = useZoom(first, last);
  const slider = useRef<HTMLInputElement>(null);
  const clock = useRef<HTMLOutputElement>(null);
  const resolution = useRef<HTMLParagraphElement>(null);
  /** The buffer that is drawn: the whole recording, or the shown part with every sample. */
  const drawn = useRef<{ key: string } & Partial<Shown>>({ key: "" });
  const frame = useRef(0);
  useEffect(() => group.setMarks(marks), [group, marks]);
  useAnimationFrame(() => {
    if (!buffer?.t.length || Number.isNaN(t.current)) return;
    const range = zoom ?? visibleRange(t.current, span, buffer.first, buffer.last);
    const source = detail?.at(range) ?? buffer;
    const key = `${t.current.toFixed(3)} ${range.join(" ")}`;
    if ((key === drawn.current.key && source === drawn.current.buffer) || frame.current++ % CHART_EVERY)
      return;
    drawn.current = { key, buffer: source, range };
    group.draw(source, range, t.current);
    showTime(t.current, slider.current, clock.current);
    if (resolution.current)
      resolution.current.dataset["resolution"] = detail && source === buffer ? "thinned" : "full";
  });
  const chooseSpan = (next: number) => {
    zoomTo(undefined);
    setSpan(next);
  };
  return {
    group,
    span,
    setSpan: chooseSpan,
    slider,
    clock,
    resolution,
    zoom,
    zoomTo,
    pan,
    /** What is drawn now. */
    shown: (): Shown | undefined => {
      const { buffer: source, range } = drawn.current;
      return source && range && { buffer: source, range, stride: source === buffer ? stride : 1 };
    },
    /** The buffer that is drawn now. */
    drawnBuffer: () => {
      const { buffer: shown } = drawn.current;
      const isInside = shown && t.current >= shown.first && t.current <= shown.last;
      return isInside ? shown : buffer;
    },
  };
}

export type PlaybackCharts = ReturnType<typeof usePlaybackCharts>;
