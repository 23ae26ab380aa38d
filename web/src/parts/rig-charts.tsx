/** The charts of a rig over time, per axis: acceleration, residual, position, command. */
import { useEffect, useMemo, useRef } from "preact/hooks";
import type { Axis } from "../api/types";
import { TraceBuffer, type AxisColumns } from "../live/buffer";
import { LineChart, type Line, type LineChartOptions, type Mark } from "./line-chart";

interface Kind {
  title: (axis: Axis) => string;
  unit: string;
  digits: number;
  least: number;
  lines: (Line & { of: Exclude<keyof AxisColumns, "enabled">; factor?: number })[];
  band?: [number, number];
  gates: boolean;
  about: string;
}

const DEGREES = 180 / Math.PI;
const COMMAND: Record<Axis, string> = { x: "qy", y: "qx" };

export const KINDS: Record<"acceleration" | "residual" | "position" | "command", Kind> = {
  acceleration: {
    title: (axis) => `Acceleration along ${axis}`,
    unit: "m/s²",
    digits: 1,
    least: 0.5,
    gates: false,
    lines: [
      { of: "measured", label: "measured", colour: "measured" },
      { of: "twin", label: "twin", colour: "twin", dash: [6, 3] },
    ],
    about: "what the ball did, and what the twin says a healthy rig would have done",
  },
  residual: {
    title: (axis) => `Residual along ${axis}`,
    unit: "m/s²",
    digits: 1,
    least: 0.3,
    gates: true,
    band: [1, 2],
    lines: [
      { of: "residual", label: "measured − twin", colour: "residual", width: 2 },
      { of: "limit", label: "limit", colour: "limit", width: 1 },
      { of: "limitBelow", label: "", colour: "limit", width: 1 },
    ],
    about: "outside the band, while the ground is tinted, it counts against the servo",
  },
  position: {
    title: (axis) => `Position ${axis}`,
    unit: "mm",
    digits: 0,
    least: 20,
    gates: false,
    lines: [
      { of: "position", label: "measured", colour: "measured", factor: 1000 },
      { of: "twinPosition", label: "twin", colour: "twin", dash: [6, 3], factor: 1000 },
    ],
    about: "where the ball is, and where the twin would be",
  },
  command: {
    title: (axis) => `Command ${COMMAND[axis]}`,
    unit: "°",
    digits: 0,
    least: 2,
    gates: false,
    lines: [
      { of: "command", label: "command", colour: "command", factor: DEGREES },
      { of: "plate", label: "twin's plate", colour: "twin", dash: [6, 3], factor: DEGREES },
    ],
    about: "the plate angle that is asked for, and the one that the twin's servo has reached",
  },
};

export type ChartKind = keyof typeof KINDS;

/** Draws all charts of a group from one buffer; nothing is rendered anew by it. */
export class ChartGroup {
  private charts = new Map<string, { chart: LineChart; kind: Kind; axis: Axis }>();
  private marks: Mark[] = [];

  add(key: string, chart: LineChart, kind: Kind, axis: Axis): void {
    this.charts.set(key, { chart, kind, axis });
    chart.setMarks(this.marks);
  }

  remove(key: string): void {
    this.charts.delete(key);
  }

  setMarks(marks: Mark[]): void {
    this.marks = marks;
    this.charts.forEach(({ chart }) => chart.setMarks(marks));
  }

  draw(buffer: TraceBuffer, range: [number, number], head: number | null = null): void {
    const from = Math.max(buffer.index(range[0]) - 1, 0);
    const to = buffer.index(range[1]) + 2;
    const cut = <T,>(column: T[]) => column.slice(from, to);
    const t = cut(buffer.t);
    this.charts.forEach(({ chart, kind, axis }) => {
      const columns = buffer[axis];
      const lines = kind.lines.map(({ of, factor }) => {
        const column = cut(columns[of]);
        return factor ? column.map((value) => (value === null ? null : value * factor)) : column;
      });
      chart.show([t, ...lines], range, kind.gates ? cut(columns.enabled) : [], head);
    });
  }
}

interface Props {
  group: ChartGroup;
  kinds: ChartKind[];
  height?: number;
  axes?: Axis[];
  onSeek?: (t: number) => void;
  /** Leaves out the lines of where the twin was: a recording has none. */
  measuredOnly?: boolean;
}

const TWINS_PLACE = ["twinPosition", "plate"];
const without = (kind: Kind): Kind => ({
  ...kind,
  lines: kind.lines.filter((line) => !TWINS_PLACE.includes(line.of)),
});

export function RigCharts({ group, kinds, height = 150, axes = ["x", "y"], onSeek, measuredOnly }: Props) {
  return (
    <div class={`charts charts-${axes.length}`}>
      {kinds.flatMap((kind) =>
        axes.map((axis) => (
          <OneChart
            key={kind + axis}
            group={group}
            kind={kind}
            axis={axis}
            height={height}
            onSeek={onSeek}
            measuredOnly={measuredOnly}
          />
        )),
      )}
    </div>
  );
}

function OneChart({
  group,
  kind: name,
  axis,
  height,
  onSeek,
  measuredOnly,
}: {
  group: ChartGroup;
  kind: ChartKind;
  axis: Axis;
  height: number;
  onSeek?: (t: number) => void;
  measuredOnly?: boolean;
}) {
  const element = useRef<HTMLDivElement>(null);
  const seek = useRef(onSeek);
  seek.current = onSeek;
  const kind = useMemo(() => (measuredOnly ? without(KINDS[name]) : KINDS[name]), [name, measuredOnly]);
  const options = useMemo<LineChartOptions>(
    () => ({
      lines: kind.lines,
      unit: kind.unit,
      digits: kind.digits,
      height,
      band: kind.band,
      least: kind.least,
      sync: "rig",
      ...(onSeek ? { onSeek: (t: number) => seek.current?.(t) } : {}),
    }),
    [kind, height],
  );
  useEffect(() => {
    const chart = new LineChart(element.current!, options);
    group.add(name + axis, chart, kind, axis);
    return () => {
      group.remove(name + axis);
      chart.destroy();
    };
  }, [group, options, axis]);
  return (
    <figure class="chart">
      <figcaption>
        <b>{kind.title(axis)}</b> <span class="quiet">{kind.unit}</span>
        <span class="keys" aria-hidden="true">
          {kind.lines
            .filter((line) => line.label)
            .map((line) => (
              <span class={`key key-${line.colour}${line.dash ? " dashed" : ""}`}>{line.label}</span>
            ))}
          {kind.gates && <span class="key key-gate">judged</span>}
        </span>
      </figcaption>
      <div
        ref={element}
        role="img"
        aria-label={`${kind.title(axis)} over time: ${kind.about}`}
        style={{ height: `${height / 16}rem` }}
      />
    </figure>
  );
}
