import type { DriveCycle } from "../../../api/types";
import { seconds } from "../../../words/numbers";

const WIDTH = 320;
const HEIGHT = 120;
/** Margin above and below the lines. */
const MARGIN = 6;
const MIDDLE = HEIGHT / 2;

/** The set points of the ball in the drive cycle over time. */
export function SetPointPlot({ cycle: { rows, duration_s } }: { cycle: DriveCycle }) {
  const values = [...rows.x_m, ...rows.y_m].filter((value) => value !== null);
  const largest = Math.max(...values.map(Math.abs), 1e-9);
  const points = (column: (number | null)[]) => {
    const placed = column.flatMap((value, i) => {
      if (value === null) return [];
      const x = (WIDTH * rows.t_s[i]!) / duration_s;
      return [`${x},${MIDDLE - ((MIDDLE - MARGIN) * value) / largest}`];
    });
    return placed.join(" ");
  };
  const label = `Set points over ${seconds(duration_s)}`;
  return (
    <figure class="trend">
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={label}>
        <line class="nominal" x1={0} x2={WIDTH} y1={MIDDLE} y2={MIDDLE} />
        <polyline class="cycle-x" points={points(rows.x_m)} />
        <polyline class="cycle-y" points={points(rows.y_m)} />
      </svg>
      <figcaption>
        <span>
          <span class="cycle-x">━</span> x
        </span>{" "}
        <span>
          <span class="cycle-y">┅</span> y
        </span>{" "}
        <span class="quiet">set points over {seconds(duration_s)}</span>
      </figcaption>
    </figure>
  );
}
