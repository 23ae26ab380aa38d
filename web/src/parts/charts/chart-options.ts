/** The uPlot options of a chart over time. */
import type uPlot from "uplot";
import { colour } from "../../theme";
import { valueLabels, valueRange, valueStep } from "./axis-labels";

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
  const time = (ticks: number[], step: number) => valueLabels(ticks, step, 0);
  const value = (ticks: (number | null)[], step: number) => valueLabels(ticks, step, digits);
  return [
    {
      ...common,
      size: 22 * scale,
      space: 60 * scale,
      values: (_, ticks, _axis, _space, step) => time(ticks, step),
    },
    {
      ...common,
      size: 46 * scale,
      space: 1,
      incrs: (_, _axis, low, high, px) => [valueStep(low, high, px / scale)],
      values: (_, ticks, _axis, _space, step) => value(ticks, step),
    },
  ];
}

type BuiltOptions = Omit<uPlot.Options, "width" | "height" | "hooks">;

export function chartOptions(
  options: LineChartOptions,
  range: () => [number, number],
  peer: () => [number, number] | undefined,
): BuiltOptions {
  const { lines, digits = 1, band, sync, minExtent = 0, isPositive = false, onZoom } = options;
  return {
    series: [{ label: "t" }, ...lines.map(series)],
    ms: 1e-3,
    legend: { show: false },
    scales: {
      x: { time: false, range },
      y: {
        range: (_, low, high) => {
          const [least, most] = peer() ?? [Infinity, -Infinity];
          return valueRange(
            Math.min(low ?? Infinity, least),
            Math.max(high ?? -Infinity, most),
            minExtent,
            isPositive,
          );
        },
      },
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
