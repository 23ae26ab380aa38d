/** How a chart over time looks: the options of uPlot that it is built with. */
import type uPlot from "uplot";
import { colour } from "../../theme";

export interface Line {
  label: string;
  /** The name of a colour of the style sheet, as in `--measured`. */
  colour: string;
  dash?: number[];
  width?: number;
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
  /** Charts with the same key share their cursor. */
  sync?: string;
  onSeek?: (t: number) => void;
}

/** How much larger than usual letters are: the style sheet enlarges all on a wall. */
export const textScale = () => parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;

const withTrueMinus = (text: string) => text.replace("-", "−");

/** The values that are shown, with room above and below. */
function valueRange(low: number | null, high: number | null, least: number): [number, number] {
  const bottom = Math.min(Number.isFinite(low) ? low! : 0, -least);
  const top = Math.max(Number.isFinite(high) ? high! : 0, least);
  const room = Math.max((top - bottom) * 0.08, 1e-6);
  return [bottom - room, top + room];
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
  const { lines, digits = 1, band, sync, least = 0 } = options;
  return {
    series: [{ label: "t" }, ...lines.map(series)],
    ms: 1e-3,
    legend: { show: false },
    scales: {
      x: { time: false, range },
      y: { range: (_, low, high) => valueRange(low, high, least) },
    },
    axes: axes(digits),
    bands: band ? [{ series: [band[0] + 1, band[1] + 1], fill: colour("band") }] : [],
    cursor: {
      drag: { x: false, y: false },
      points: { size: 6 },
      ...(sync ? { sync: { key: sync, setSeries: false } } : {}),
    },
  };
}
