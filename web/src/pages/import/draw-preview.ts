import { colour } from "../../theme";
import { extent, finite, type Columns } from "./columns";

/** Largest number of drawn points. */
const MAX_POINTS = 4000;

/** Margin around the path, px. */
const MARGIN = 20;

/** Draws the path of the ball in a file, scaled to the canvas. */
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
  const step = Math.max(Math.floor(t_s.length / MAX_POINTS), 1);
  // The line has a gap where the position is missing.
  let isContinued = false;
  for (let i = 0; i < t_s.length; i += step) {
    const x = x_m[i];
    const y = y_m[i];
    const isSeen = x != null && y != null;
    if (isSeen) {
      const px = width / 2 + (x - (left + right) / 2) * scale;
      const py = height / 2 - (y - (bottom + top) / 2) * scale;
      if (isContinued) context.lineTo(px, py);
      else context.moveTo(px, py);
    }
    isContinued = isSeen;
  }
  context.stroke();
}
