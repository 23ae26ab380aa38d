import type { Axis } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";
import type { ChartKind } from "./chart-kinds";
import type { LineChart } from "./line-chart";
import type { Mark } from "./overlays";

interface GroupedChart {
  chart: LineChart;
  kind: ChartKind;
  axis: Axis;
}

interface Drawn {
  buffer: TraceBuffer;
  range: [number, number];
  playhead: number | null;
}

/** Charts that are drawn together from one buffer, without rendering components. */
export class ChartGroup {
  private charts = new Map<string, GroupedChart>();
  /** What was drawn last; a chart that is added later shows it, too. */
  private drawn?: Drawn;
  private marks: Mark[] = [];
  /** Charts beside these, with the same scales. */
  private peer?: ChartGroup;

  add(key: string, chart: LineChart, kind: ChartKind, axis: Axis): void {
    this.charts.set(key, { chart, kind, axis });
    chart.peerExtent = () => this.peer?.extent(key);
    chart.setMarks(this.marksOf(kind, axis));
    if (!this.drawn) return;
    this.drawOne({ chart, kind, axis }, this.drawn);
    this.peer?.charts.get(key)?.chart.rescale();
  }

  /** Gives these charts and those of `peer` the same scales. */
  share(peer: ChartGroup): void {
    this.peer = peer;
    peer.peer = this;
  }

  /** The least and greatest value of the chart `key`. */
  private extent(key: string): [number, number] | undefined {
    return this.charts.get(key)?.chart.extent();
  }

  remove(key: string): void {
    this.charts.delete(key);
  }

  setMarks(marks: Mark[]): void {
    this.marks = marks;
    this.charts.forEach(({ chart, kind, axis }) => chart.setMarks(this.marksOf(kind, axis)));
  }

  /** The marks of an axis; only the charts of the residual, on which the verdict is based, have their labels. */
  private marksOf(kind: ChartKind, axis: Axis): Mark[] {
    const own = this.marks.filter((mark) => !mark.axis || mark.axis === axis);
    return kind.hasMarkLabels ? own : own.map((mark) => ({ ...mark, label: "" }));
  }

  /** Draws the moments of `range`; `playhead` is the current time of the playback. */
  draw(buffer: TraceBuffer, range: [number, number], playhead: number | null = null): void {
    this.drawn = { buffer, range, playhead };
    this.charts.forEach((one) => this.drawOne(one, this.drawn!));
    this.peer?.charts.forEach(({ chart }) => chart.rescale());
  }

  private drawOne({ chart, kind, axis }: GroupedChart, { buffer, range, playhead }: Drawn): void {
    const from = Math.max(buffer.index(range[0]) - 1, 0);
    const to = buffer.index(range[1]) + 2;
    const cut = <T>(column: T[]) => column.slice(from, to);
    const columns = { ...buffer.shared, ...buffer[axis] };
    const lines = kind.lines.map(({ column, factor }) => {
      const values = cut(columns[column]);
      return factor ? values.map((value) => (value === null ? null : value * factor)) : values;
    });
    const gates = kind.showsGates ? cut(columns.enabled) : [];
    chart.show([cut(buffer.t), ...lines], range, gates, playhead);
  }
}
