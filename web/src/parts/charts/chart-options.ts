/** The uPlot options of a chart over time. */
import type uPlot from "uplot";
import { colour } from "../../theme";

export interface Line {
  label: string;
  /** The name of a colour of the style sheet, as in `--measured`. */
  colour: string;
  dash?: number[];
  width?: number;
}

/** A value that decides, drawn as a horizontal line. */
export interface Threshold {
  value: number;
  label: string;
}

export interface LineChartOptions {
  lines: Line[];
  unit: string;
  /** Decimals of the axis labels. */
  digits?: number;
  height: number;
  /** Indices of the upper and lower line between which the band is filled. */
  band?: [number, number];
  thresholds?: Threshold[];
  /** Smallest extent of the scale on either side of zero. */
  minExtent?: number;
  /** Whether no value is negative, so that the scale begins at zero. */
  isPositive?: boolean;
  /** Charts with the same key share their cursor. */
  sync?: string;
  onSeek?: (t: number) => void;
  /** Called with the range over which the pointer was dragged, and without one after a double click. */
  onZoom?: (range: [number, number] | undefined) => void;
  /** Called with the moment under the cursor and the value of each line; with null when the cursor has left. */
  onCursor?: (t: number | null, values: (number | null | undefined)[]) => void;
}

/** Scale of the text: the style sheet enlarges it on large screens. */
export const textScale = () => parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;

const withTrueMinus = (text: string) => text.replace("-", "−");

/** Returns the range of the value axis, with a margin above and below. */
function valueRange(
  low: number | null,
  high: number | null,
  minExtent: number,
  isPositive: boolean,
): [number, number] {
  const bottom = isPositive ? 0 : Math.min(Number.isFinite(low) ? low! : 0, -minExtent);
  const top = Math.max(Number.isFinite(high) ? high! : 0, minExtent);
  const margin = Math.max((top - bottom) * 0.08, 1e-6);
  return [bottom - margin, top + margin];
}

const series = (line: Line): uPlot.Series => ({
  label: line.label,
  stroke: colour(line.colour),
  width: line.width ?? 1.5,
  dash: line.dash,
  points: { show: false },
  spanGaps: false,
});

function axes(digits: number): uPlot.Axis[] {
  const scale = textScale();
  const common: uPlot.Axis = {
    stroke: colour("quiet"),
    grid: { stroke: colour("grid"), width: 1 },
    ticks: { show: false },
    font: `${12 * scale}px system-ui, sans-serif`,
    gap: 4,
  };
  const time = (t: number) => withTrueMinus(`${Number(t.toFixed(2))}`);
  const value = (n: number | null) => (n === null ? "" : withTrueMinus(n.toFixed(digits)));
  return [
    { ...common, size: 22 * scale, space: 60 * scale, values: (_, ticks) => ticks.map(time) },
    { ...common, size: 46 * scale, space: 26 * scale, values: (_, ticks) => ticks.map(value) },
  ];
}

type BuiltOptions = Omit<uPlot.Options, "width" | "height" | "hooks">;

export function chartOptions(options: LineChartOptions, range: () => [number, number]): BuiltOptions {
  const { lines, digits = 1, band, sync, minExtent = 0, isPositive = false, onZoom } = options;
  return {
    series: [{ label: "t" }, ...lines.map(series)],
    ms: 1e-3,
    legend: { show: false },
    scales: {
      x: { time: false, range },
      y: { range: (_, low, high) => valueRange(low, high, minExtent, isPositive) },
    },
    axes: axes(digits),
    bands: band ? [{ series: [band[0] + 1, band[1] + 1], fill: colour("band") }] : [],
    cursor: {
      drag: { x: onZoom !== undefined, y: false, setScale: false, dist: 5 },
      points: { size: 6 },
      ...(sync ? { sync: { key: sync, setSeries: false } } : {}),
    },
  };
}
