import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Axis } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import type { ChartGroup } from "./chart-group";
import { CHART_KINDS, withoutTwinPositions, type ChartKind, type ChartKindName } from "./chart-kinds";
import { ChartKey } from "./chart-key";
import { LineChart } from "./line-chart";

interface Props {
  group: ChartGroup;
  kind: ChartKindName;
  axis: Axis;
  height: number;
  onSeek?: (t: number) => void;
  measuredOnly?: boolean;
}

/** One chart of a rig; it is drawn by its group. */
export function RigChart({ group, kind: name, axis, height, onSeek, measuredOnly }: Props) {
  const element = useRef<HTMLDivElement>(null);
  const seek = useLatest(onSeek);
  const canSeek = onSeek !== undefined;
  const kind: ChartKind = useMemo(
    () => (measuredOnly ? withoutTwinPositions(CHART_KINDS[name]) : CHART_KINDS[name]),
    [name, measuredOnly],
  );
  useEffect(() => {
    const { lines, unit, digits, band, minExtent } = kind;
    const onSeek = canSeek ? (t: number) => seek.current?.(t) : undefined;
    const options = { lines, unit, digits, height, band, minExtent, sync: "rig", onSeek };
    const chart = new LineChart(element.current!, options);
    group.add(name + axis, chart, kind, axis);
    return () => {
      group.remove(name + axis);
      chart.destroy();
    };
  }, [group, kind, name, axis, height, canSeek, seek]);
  const style = { height: `${height / 16}rem` };
  return (
    <figure class="chart">
      <figcaption>
        <b>{kind.title(axis)}</b> <span class="quiet">{kind.unit}</span>
        <ChartKey kind={kind} />
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
