import { colour } from "../../theme";
import { extent, finite, type Columns } from "./columns";

/** Points drawn at most. */
const MOST_POINTS = 4000;

/** Room about the ball's way, px. */
const MARGIN = 20;

/** Draws the ball's way in a file, as large as the canvas has room for it. */
export function drawPreview(canvas: HTMLCanvasElement, { t_s, x_m, y_m }: Columns): void {
  const { clientWidth: width, clientHeight: height } = canvas;
  Object.assign(canvas, { width: width * devicePixelRatio, height: height * devicePixelRatio });
  const context = canvas.getContext("2d")!;
  context.scale(devicePixelRatio, devicePixelRatio);
  const [left, right] = extent(finite(x_m));
  const [bottom, top] = extent(finite(y_m));
  if (!Number.isFinite(left) || !Number.isFinite(bottom)) return;
  const fit = (pixels: number, metres: number) => (pixels - MARGIN) / Math.max(metres, 1e-6);
  const scale = Math.min(fit(width, right - left), fit(height, top - bottom));
  context.strokeStyle = colour("measured");
  context.lineWidth = 1.2;
  context.beginPath();
  const step = Math.max(Math.floor(t_s.length / MOST_POINTS), 1);
  // Whether the line goes on from the point before: it has a gap where no ball was seen.
  let goesOn = false;
  for (let i = 0; i < t_s.length; i += step) {
    const x = x_m[i];
    const y = y_m[i];
    const isSeen = x != null && y != null;
    if (isSeen) {
      const px = width / 2 + (x - (left + right) / 2) * scale;
      const py = height / 2 - (y - (bottom + top) / 2) * scale;
      if (goesOn) context.lineTo(px, py);
      else context.moveTo(px, py);
    }
    goesOn = isSeen;
  }
  context.stroke();
}
