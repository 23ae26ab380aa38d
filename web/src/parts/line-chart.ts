/** A chart over time: uPlot with this page's colours, shaded gates, marks and a shared cursor. */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { colour, onTheme } from "../theme";

export interface Line {
  label: string;
  /** The name of a colour of the style sheet, as in `--measured`. */
  colour: string;
  dash?: number[];
  width?: number;
  hidden?: boolean;
}

export interface Mark {
  t: number;
  label: string;
  colour: string;
}

export interface LineChartOptions {
  lines: Line[];
  unit: string;
  /** Digits after the point on the axis. */
  digits?: number;
  height: number;
  /** Two lines between which the band is filled: the upper and the lower. */
  band?: [number, number];
  /** The scale never shows less than this much either side of zero. */
  least?: number;
  sync?: string;
  onSeek?: (t: number) => void;
}

type Data = [number[], ...(number | null)[][]];

/** How much larger than usual letters are: the style sheet enlarges all on a wall. */
const scale = () => parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;

export class LineChart {
  private plot?: uPlot;
  private data: Data;
  private range: [number, number] = [0, 1];
  private gates: boolean[] = [];
  private marks: Mark[] = [];
  private head: number | null = null;
  private readonly stop: (() => void)[] = [];

  constructor(
    private readonly element: HTMLElement,
    private readonly options: LineChartOptions,
  ) {
    this.data = [[], ...options.lines.map(() => [])] as Data;
    this.build();
    const resized = new ResizeObserver(() => this.plot?.setSize(this.size()));
    resized.observe(element);
    this.stop.push(
      () => resized.disconnect(),
      onTheme(() => this.build()),
    );
  }

  destroy(): void {
    this.stop.forEach((stop) => stop());
    this.plot?.destroy();
  }

  /** Shows `data` from `from` to `to`; `gates` says where the residual may be judged. */
  show(data: Data, range: [number, number], gates: boolean[] = [], head: number | null = null): void {
    this.data = data;
    this.range = range;
    this.gates = gates;
    this.head = head;
    this.plot?.batch(() => {
      this.plot?.setData(data, false);
      this.plot?.setScale("x", { min: range[0], max: range[1] });
    });
  }

  setMarks(marks: Mark[]): void {
    this.marks = marks;
    this.plot?.redraw(false);
  }

  private size() {
    return {
      width: Math.max(this.element.clientWidth, 120),
      height: this.element.clientHeight || this.options.height,
    };
  }

  private build(): void {
    this.plot?.destroy();
    const { lines, digits = 1, band, sync, least = 0 } = this.options;
    const large = scale();
    const font = `${12 * large}px system-ui, sans-serif`;
    const axis = {
      stroke: colour("quiet"),
      grid: { stroke: colour("grid"), width: 1 },
      ticks: { show: false },
      font,
      gap: 4,
    };
    const plain = (n: number | null) => (n === null ? "" : n.toFixed(digits).replace("-", "−"));
    const series: uPlot.Series[] = [
      { label: "t" },
      ...lines.map((line): uPlot.Series => ({
        label: line.label,
        stroke: colour(line.colour),
        width: line.width ?? 1.5,
        dash: line.dash,
        points: { show: false },
        show: !line.hidden,
        spanGaps: false,
      })),
    ];
    this.plot = new uPlot(
      {
        ...this.size(),
        series,
        ms: 1e-3,
        legend: { show: false },
        scales: {
          x: { time: false, range: () => this.range },
          y: { range: (_, low, high) => this.scale(low, high, least) },
        },
        axes: [
          {
            ...axis,
            size: 22 * large,
            values: (_, ticks) => ticks.map((t) => `${Number(t.toFixed(2))}`.replace("-", "−")),
            space: 60 * large,
          },
          { ...axis, size: 46 * large, values: (_, ticks) => ticks.map(plain), space: 26 * large },
        ],
        bands: band ? [{ series: [band[0] + 1, band[1] + 1], fill: colour("band") }] : [],
        cursor: {
          drag: { x: false, y: false },
          points: { size: 6 },
          ...(sync ? { sync: { key: sync, setSeries: false } } : {}),
        },
        hooks: {
          drawClear: [(plot) => this.shade(plot)],
          draw: [(plot) => this.mark(plot)],
          ready: [(plot) => this.listen(plot)],
        },
      },
      this.data,
      this.element,
    );
  }

  private scale(low: number, high: number, least: number): [number, number] {
    const bottom = Math.min(Number.isFinite(low) ? low : 0, -least);
    const top = Math.max(Number.isFinite(high) ? high : 0, least);
    const room = Math.max((top - bottom) * 0.08, 1e-6);
    return [bottom - room, top + room];
  }

  private listen(plot: uPlot): void {
    const { onSeek } = this.options;
    if (onSeek) plot.over.addEventListener("click", (event) => onSeek(plot.posToVal(event.offsetX, "x")));
  }

  /** Where the gate is open the ground is tinted. */
  private shade(plot: uPlot): void {
    const { ctx, bbox } = plot;
    const times = this.data[0];
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = colour("gate");
    let from: number | null = null;
    for (let i = 0; i <= this.gates.length; i++) {
      const open = this.gates[i] === true;
      if (open && from === null) from = times[i]!;
      if (!open && from !== null) {
        const left = plot.valToPos(from, "x", true);
        const right = plot.valToPos(times[Math.min(i, times.length - 1)]!, "x", true);
        ctx.fillRect(left, bbox.top, right - left, bbox.height);
        from = null;
      }
    }
    ctx.restore();
  }

  private mark(plot: uPlot): void {
    const { ctx, bbox } = plot;
    const lines: Mark[] =
      this.head === null ? this.marks : [...this.marks, { t: this.head, label: "", colour: "ink" }];
    ctx.save();
    const line = 12 * scale() * devicePixelRatio;
    ctx.font = `${line * 0.92}px system-ui, sans-serif`;
    // Labels that would cover each other go into rows.
    const rows: number[] = [];
    for (const mark of lines) {
      if (mark.t < this.range[0] || mark.t > this.range[1]) continue;
      const x = Math.round(plot.valToPos(mark.t, "x", true));
      ctx.strokeStyle = ctx.fillStyle = colour(mark.colour);
      ctx.lineWidth = devicePixelRatio * (mark.label ? 1.5 : 1);
      ctx.setLineDash(mark.label ? [4 * devicePixelRatio, 3 * devicePixelRatio] : []);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      const width = ctx.measureText(mark.label).width + 6 * devicePixelRatio;
      const fits = x + width < bbox.left + bbox.width;
      const left = fits ? x : x - width;
      const free = rows.findIndex((end) => end <= left);
      const row = free < 0 ? rows.length : free;
      rows[row] = left + width;
      ctx.textAlign = fits ? "left" : "right";
      ctx.fillText(mark.label, x + (fits ? 4 : -4) * devicePixelRatio, bbox.top + (row + 0.9) * line);
    }
    ctx.restore();
  }
}
