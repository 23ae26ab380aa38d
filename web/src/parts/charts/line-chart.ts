/** A chart over time: uPlot with the colours of the theme, shaded gates, marks and a shared cursor. */
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { onTheme } from "../../theme";
import { chartOptions, type LineChartOptions } from "./chart-options";
import { extentOf } from "./axis-labels";
import { drawMarks, drawThresholdLabels, drawThresholds, shadeGates, type Mark } from "./overlays";

/** Movement of a pressed pointer from which on it is a drag and not a click, px. */
const MIN_DRAG_PX = 5;

export type ChartData = [number[], ...(number | null)[][]];

export class LineChart {
  private plot?: uPlot;
  private data: ChartData;
  private range: [number, number] = [0, 1];
  private gates: boolean[] = [];
  private marks: Mark[] = [];
  /** The current time of the playback, marked by a line. */
  private playhead: number | null = null;
  private readonly cleanups: (() => void)[] = [];

  constructor(
    private readonly element: HTMLElement,
    private readonly options: LineChartOptions,
  ) {
    this.data = [[], ...options.lines.map(() => [])];
    this.build();
    const resized = new ResizeObserver(() => this.plot?.setSize(this.size()));
    resized.observe(element);
    // The colours are set when the plot is built.
    this.cleanups.push(
      () => resized.disconnect(),
      onTheme(() => this.build()),
    );
  }

  destroy(): void {
    this.cleanups.forEach((cleanup) => cleanup());
    this.plot?.destroy();
  }

  /** Shows `data` over `range`; `gates` has whether the residual is judged at each moment. */
  show(
    data: ChartData,
    range: [number, number],
    gates: boolean[] = [],
    playhead: number | null = null,
  ): void {
    this.data = data;
    this.range = range;
    this.gates = gates;
    this.playhead = playhead;
    this.plot?.batch(() => {
      this.plot?.setData(data, false);
      this.plot?.setScale("x", { min: range[0], max: range[1] });
    });
  }

  /** The extent of a chart beside this one, with the same scale. */
  peerExtent: () => [number, number] | undefined = () => undefined;

  /** The least and greatest value of all lines in the shown range; undefined without any. */
  extent = () => extentOf(this.data.slice(1));

  /** Adopts the scale of what a chart beside this one shows now. */
  rescale(): void {
    this.show(this.data, this.range, this.gates, this.playhead);
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
    const options = {
      ...this.size(),
      ...chartOptions(
        this.options,
        () => this.range,
        () => this.peerExtent(),
      ),
      hooks: {
        drawClear: [
          (plot: uPlot) => shadeGates(plot, this.data[0], this.gates),
          (plot: uPlot) => drawThresholds(plot, this.options.thresholds ?? []),
        ],
        draw: [
          (plot: uPlot) => drawThresholdLabels(plot, this.options.thresholds ?? []),
          (plot: uPlot) => this.drawMarks(plot),
        ],
        ready: [(plot: uPlot) => this.listen(plot)],
        setCursor: [(plot: uPlot) => this.tellCursor(plot)],
        setSelect: [(plot: uPlot) => this.zoomToSelection(plot)],
      },
    };
    this.plot = new uPlot(options, this.data, this.element);
  }

  private drawMarks(plot: uPlot): void {
    const playhead: Mark[] =
      this.playhead === null ? [] : [{ t: this.playhead, label: "", colour: "ink", isPlayhead: true }];
    const [from, to] = this.range;
    drawMarks(
      plot,
      [...this.marks, ...playhead].filter(({ t }) => t >= from && t <= to),
    );
  }

  /** Tells the values at the moment under the cursor. */
  private tellCursor(plot: uPlot): void {
    const { idx } = plot.cursor;
    const [t, ...lines] = this.data;
    if (idx == null) this.options.onCursor?.(null, []);
    else
      this.options.onCursor?.(
        t[idx] ?? null,
        lines.map((line) => line[idx]),
      );
  }

  /** Zooms to the range over which the pointer was dragged. */
  private zoomToSelection(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width < MIN_DRAG_PX) return;
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.options.onZoom?.([plot.posToVal(left, "x"), plot.posToVal(left + width, "x")]);
  }

  private listen(plot: uPlot): void {
    const { onSeek, onZoom } = this.options;
    let pressedAt = NaN;
    plot.over.addEventListener("mousedown", (event) => (pressedAt = event.offsetX));
    plot.over.addEventListener("click", (event) => {
      const isDragged = Math.abs(event.offsetX - pressedAt) >= MIN_DRAG_PX;
      if (!isDragged) onSeek?.(plot.posToVal(event.offsetX, "x"));
    });
    if (onZoom) plot.over.addEventListener("dblclick", () => onZoom(undefined));
  }
}
