import type { PlateSize } from "../../live/rig-size";

/** Room about the plate, px. */
const MARGIN = 24;

/** A canvas on which the plate is seen from above: x to the right, y up. */
export interface PlanView {
  context: CanvasRenderingContext2D;
  /** Pixels for a metre. */
  scale: number;
  /** Where a point of the plate, m, is on the canvas. */
  place: (x: number, y: number) => [number, number];
}

/** The canvas, empty, with as many pixels as the screen shows of it. */
export function planView(canvas: HTMLCanvasElement, plate: PlateSize): PlanView {
  const { clientWidth: width, clientHeight: height } = canvas;
  const ratio = devicePixelRatio;
  if (canvas.width !== width * ratio || canvas.height !== height * ratio)
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
  const context = canvas.getContext("2d")!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  const scale = Math.min((width - MARGIN) / plate.length, (height - MARGIN) / plate.width);
  return { context, scale, place: (x, y) => [width / 2 + x * scale, height / 2 - y * scale] };
}
