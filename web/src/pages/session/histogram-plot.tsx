import type { Axis } from "../../api/types";
import { count, number } from "../../words/numbers";
import type { Histogram } from "./histogram";

const WIDTH = 300;
const HEIGHT = 90;

interface Props {
  axis: Axis;
  histogram: Histogram;
  /** What is counted. */
  moments: string;
}

/** A bar for each bin, and the limit on both sides. */
export function HistogramPlot({ axis, histogram, moments }: Props) {
  const { counts, extent, n, nBeyond, limit } = histogram;
  const most = Math.max(...counts);
  const width = WIDTH / counts.length;
  const x = (value: number) => (WIDTH * (value + extent)) / (2 * extent);
  const label =
    `Histogram of the residual along ${axis}: ${count(nBeyond)} of ${count(n)} ${moments} ` +
    `are at or beyond the limit`;
  return (
    <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={label}>
      {counts.map((height, i) => {
        const tall = (HEIGHT * height) / most;
        return <rect x={i * width} y={HEIGHT - tall} width={Math.max(width - 1, 0.5)} height={tall} />;
      })}
      {[-limit, limit].map((value) => (
        <line class="limit" x1={x(value)} x2={x(value)} y1={0} y2={HEIGHT}>
          <title>limit {number(value, 3, "m/s²")}</title>
        </line>
      ))}
    </svg>
  );
}
