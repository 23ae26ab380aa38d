import type { PlateSize } from "../../live/rig-size";

/** Margin around the plate, px. */
const MARGIN = 24;

/** A canvas with the plate seen from above: x to the right, y up. */
export interface PlanView {
  context: CanvasRenderingContext2D;
  /** Pixels per metre. */
  scale: number;
  /** Converts a point of the plate, m, to a point of the canvas, px. */
  toCanvas: (x: number, y: number) => [number, number];
}

/** Clears the canvas and fits its resolution to the screen. */
export function planView(canvas: HTMLCanvasElement, plate: PlateSize): PlanView {
  const { clientWidth: width, clientHeight: height } = canvas;
  const ratio = devicePixelRatio;
  if (canvas.width !== width * ratio || canvas.height !== height * ratio)
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const scale = Math.min((width - MARGIN) / plate.length, (height - MARGIN) / plate.width);
  return { context, scale, toCanvas: (x, y) => [width / 2 + x * scale, height / 2 - y * scale] };
}
