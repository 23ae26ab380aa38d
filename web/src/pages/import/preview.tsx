import { useEffect, useRef } from "preact/hooks";
import type { FileInspection } from "../../api/types";
import { count, number, seconds } from "../../words/numbers";
import { drawPreview } from "./draw-preview";

/** What the file holds: the motion of the ball, and figures that reveal a wrong unit. */
export function Preview({ inspection }: { inspection: FileInspection }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const { motion, format, layout, rows, from_s, to_s, rate_hz, without_ball } = inspection;
  useEffect(() => drawPreview(canvas.current!, motion), [motion]);
  const length = (to_s ?? 0) - (from_s ?? 0);
  return (
    <div class="preview">
      <canvas ref={canvas} class="xy" role="img" aria-label="Motion of the ball in the file" />
      <ul class="plain">
        <li>{layout.length ? layout.join("; ") : format}</li>
        <li>
          {count(rows)} rows over {seconds(length, 1)}: {number(rate_hz, 1, "Hz")}
        </li>
        <li>Ball seen in {number(100 * (1 - without_ball), 0, "%")} of the rows</li>
      </ul>
    </div>
  );
}
