import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Axis } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import { Term } from "../term";
import type { ChartGroup } from "./chart-group";
import { CHART_KINDS, withoutTwinPositions, type ChartKind, type ChartKindName } from "./chart-kinds";
import type { Threshold } from "./chart-options";
import { ChartKey } from "./chart-key";
import { CursorValues } from "./cursor-values";
import { LineChart } from "./line-chart";

interface Props {
  group: ChartGroup;
  kind: ChartKindName;
  axis: Axis;
  height: number;
  onSeek?: (t: number) => void;
  onZoom?: (range: [number, number] | undefined) => void;
  measuredOnly?: boolean;
  minExtent?: number;
  /** The values that decide, if they are those of the rig. */
  thresholds?: Threshold[];
}

/** One chart of a rig; it is drawn by its group. */
export function RigChart(props: Props) {
  const { group, kind: name, axis, height, measuredOnly, minExtent, thresholds, ...handlers } = props;
  const element = useRef<HTMLDivElement>(null);
  const key = useRef<HTMLSpanElement>(null);
  const latest = useLatest(handlers);
  const canSeek = handlers.onSeek !== undefined;
  const canZoom = handlers.onZoom !== undefined;
  const kind: ChartKind = useMemo(
    () => (measuredOnly ? withoutTwinPositions(CHART_KINDS[name]) : CHART_KINDS[name]),
    [name, measuredOnly],
  );
  useEffect(() => {
    const values = new CursorValues(key.current!, kind);
    const chart = new LineChart(element.current!, {
      ...kind,
      height,
      minExtent: minExtent ?? kind.minExtent,
      thresholds: thresholds ?? kind.thresholds,
      sync: "rig",
      onSeek: canSeek ? (t) => latest.current.onSeek?.(t) : undefined,
      onZoom: canZoom ? (range) => latest.current.onZoom?.(range) : undefined,
      onCursor: (t, column) => values.show(t, column),
    });
    group.add(name + axis, chart, kind, axis);
    return () => {
      group.remove(name + axis);
      chart.destroy();
    };
  }, [group, kind, name, axis, height, minExtent, thresholds, canSeek, canZoom, latest]);
  const style = { height: `${height / 16}rem` };
  return (
    <figure class="chart">
      <figcaption>
        <b>{kind.term ? <Term of={kind.term}>{kind.title(axis)}</Term> : kind.title(axis)}</b>{" "}
        <span class="quiet">{kind.unit}</span>
        <ChartKey kind={kind} element={key} />
      </figcaption>
      <div
        ref={element}
        role="img"
        aria-label={`${kind.title(axis)} over time: ${kind.about}`}
        style={style}
      />
    </figure>
  );
}
