import { useEffect, useMemo, useRef } from "preact/hooks";
import uPlot from "uplot";
import type { Axis } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import { TraceBuffer } from "../../live/buffer";
import { ChartKey } from "../../parts/charts/chart-key";
import { CHART_KINDS, type ChartKind, type ChartKindName } from "../../parts/charts/chart-kinds";
import { CursorValues } from "../../parts/charts/cursor-values";
import { LineChart, type ChartData } from "../../parts/charts/line-chart";
import { alignedTrace, difference, valuesAt } from "./align";
import type { Recording } from "./use-recording";

const HEIGHT = 160;

interface Props {
  kind: ChartKindName;
  axis: Axis;
  a: Recording;
  b: Recording;
  shift: number;
  range: [number, number];
  onZoom: (range: [number, number] | undefined) => void;
}

/** Returns the kind with its first line for each of two recordings, of these names, and for their difference. */
function overlaidKind(name: ChartKindName, names: [string, string]): ChartKind {
  const kind: ChartKind = CHART_KINDS[name];
  const line = kind.lines[0]!;
  const [a, b] = names;
  const lines = [
    { ...line, label: a, colour: "measured" },
    { ...line, label: b, colour: "residual", dash: [6, 3] },
    // How much higher one counter is says nothing.
    ...(name === "counter" ? [] : [{ ...line, label: "first − second", colour: "twin", width: 1 }]),
  ];
  return {
    ...kind,
    lines,
    band: undefined,
    showsGates: false,
    about: `of ${a} and of ${b}, and their difference`,
  };
}

/** The first quantity of a kind of chart in two recordings and its difference, in one chart. */
export function OverlaidChart({ kind: name, axis, a, b, shift, range, onZoom }: Props) {
  const element = useRef<HTMLDivElement>(null);
  const key = useRef<HTMLSpanElement>(null);
  const chart = useRef<LineChart>(undefined);
  const zoom = useLatest(onZoom);
  const kind = useMemo(
    () => overlaidKind(name, [a.session.name, b.session.name]),
    [name, a.session.name, b.session.name],
  );
  const data = useMemo(() => {
    const { column, factor = 1 } = kind.lines[0]!;
    const curve = (recording: Recording, start: number): [number[], (number | null)[]] => {
      const buffer = TraceBuffer.of(alignedTrace(recording.trace, start));
      const values = { ...buffer.shared, ...buffer[axis] }[column];
      return [buffer.t, values.map((value) => (value === null ? null : value * factor))];
    };
    const curves = [curve(a, 0), curve(b, shift)] as const;
    const differences = kind.lines.length > 2 ? [difference(...curves)] : [];
    return uPlot.join([...curves, ...differences]) as ChartData;
  }, [kind, axis, a, b, shift]);
  const latest = useLatest(data);
  useEffect(() => {
    const values = new CursorValues(key.current!, kind);
    const drawn = new LineChart(element.current!, {
      ...kind,
      height: HEIGHT,
      sync: "rig",
      onZoom: (zoomed) => zoom.current(zoomed),
      onCursor: (t) => values.show(t, t === null ? [] : valuesAt(latest.current, t)),
    });
    chart.current = drawn;
    return () => drawn.destroy();
  }, [kind, zoom, latest]);
  useEffect(() => chart.current?.show(data, range), [kind, data, range]);
  return (
    <figure class="chart">
      <figcaption>
        <b>{kind.title(axis)}</b> <span class="quiet">{kind.unit}</span>
        <ChartKey kind={kind} element={key} />
      </figcaption>
      <div
        ref={element}
        role="img"
        aria-label={`${kind.title(axis)} over time: ${kind.about}`}
        style={{ height: `${HEIGHT / 16}rem` }}
      />
    </figure>
  );
}
