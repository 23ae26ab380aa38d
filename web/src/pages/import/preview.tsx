import { useEffect, useRef } from "preact/hooks";
import { count, millimetres, number, seconds } from "../../words/numbers";
import { countSeen, extent, finite, type Columns } from "./columns";
import { drawPreview } from "./draw-preview";

/** Formats the range of a column. */
function rangeText(column: (number | null)[]): string {
  const known = finite(column);
  if (!known.length) return "unknown";
  const [low, high] = extent(known);
  return `from ${millimetres(low, 0)} to ${millimetres(high, 0)}`;
}

/** A preview of the session: the path of the ball, and values that reveal a wrong unit. */
export function Preview({ columns }: { columns: Columns }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => drawPreview(canvas.current!, columns), [columns]);
  const { t_s, x_m, y_m, cmd_qx_rad, cmd_qy_rad } = columns;
  const t = finite(t_s);
  const length = t.length > 1 ? t[t.length - 1]! - t[0]! : 0;
  const rate = length > 0 ? (t.length - 1) / length : null;
  const nSeen = countSeen(columns);
  const commands = [...finite(cmd_qx_rad), ...finite(cmd_qy_rad)].map(Math.abs);
  const largestAngle = Math.max(extent(commands)[1], 0);
  return (
    <div class="preview">
      <canvas ref={canvas} class="xy" role="img" aria-label="Path of the ball in the file" />
      <ul class="plain">
        <li>
          {count(t.length)} rows over {seconds(length, 1)}: {number(rate, 1, "Hz")}
        </li>
        <li>Ball seen in {number((100 * nSeen) / Math.max(t.length, 1), 0, "%")} of the rows</li>
        <li>
          x {rangeText(x_m)}, y {rangeText(y_m)}
        </li>
        <li>Largest command {number((largestAngle * 180) / Math.PI, 1, "°")}</li>
      </ul>
    </div>
  );
}
