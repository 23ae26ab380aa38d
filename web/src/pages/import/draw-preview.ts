import type { FileMotion } from "../../api/types";
import { colour } from "../../theme";

/** Margin around the path, px. */
const MARGIN = 20;

/** Draws the path of the ball, or its only coordinate over time, to the size of the canvas. */
export function drawPreview(canvas: HTMLCanvasElement, { t_s, x_m, y_m }: FileMotion): void {
  const { clientWidth: width, clientHeight: height } = canvas;
  Object.assign(canvas, { width: width * devicePixelRatio, height: height * devicePixelRatio });
  const context = canvas.getContext("2d")!;
  context.scale(devicePixelRatio, devicePixelRatio);
  const has = (column: (number | null)[]) => column.some((value) => value !== null);
  const isPath = has(x_m) && has(y_m);
  const across = isPath ? x_m : t_s;
  const up = isPath || has(y_m) ? y_m : x_m;
  const seen = t_s.flatMap((_, i) => (across[i] != null && up[i] != null ? [i] : []));
  if (!seen.length) return;
  const range = (column: (number | null)[]): [number, number] => {
    const values = seen.map((i) => column[i]!);
    return [Math.min(...values), Math.max(...values)];
  };
  const [left, right] = range(across);
  const [bottom, top] = range(up);
  const fit = (pixels: number, size: number) => (pixels - MARGIN) / Math.max(size, 1e-6);
  const both = Math.min(fit(width, right - left), fit(height, top - bottom));
  const [scaleX, scaleY] = isPath ? [both, both] : [fit(width, right - left), fit(height, top - bottom)];
  context.strokeStyle = colour("measured");
  context.lineWidth = 1.2;
  context.beginPath();
  let last = -2;
  for (const i of seen) {
    const px = width / 2 + (across[i]! - (left + right) / 2) * scaleX;
    const py = height / 2 - (up[i]! - (bottom + top) / 2) * scaleY;
    // The line has a gap where the position is missing.
    if (i === last + 1) context.lineTo(px, py);
    else context.moveTo(px, py);
    last = i;
  }
  context.stroke();
}
