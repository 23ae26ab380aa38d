/** Draws the path of the ball on the plate, seen from above. */
import type { Asset } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";
import { ballAt, type PlanePoint } from "../../live/pose";
import { ballRadius, plateSize } from "../../live/rig-size";
import { colour } from "../../theme";
import { drawPlate, drawServos } from "./draw-plate";
import { planView, type PlanView } from "./plan-view";

export interface TraceMoment {
  buffer: TraceBuffer;
  /** End of the drawn path, s on the device's clock. */
  t: number;
  /** Duration of the drawn path, s. */
  tail: number;
}

/** The twin is drawn first, so that the measured path is on top. */
const LAYERS = [
  { column: "twinPosition", colour: "twin", dash: [5, 3], opacity: 0.45 },
  { column: "position", colour: "measured", dash: [], opacity: 1 },
] as const;

type Layer = (typeof LAYERS)[number];

/** Smallest radius of the drawn ball, px. */
const MIN_RADIUS = 4;

export function drawXyTrace(canvas: HTMLCanvasElement, asset: Asset, moment: TraceMoment): void {
  const plate = plateSize(asset);
  const view = planView(canvas, plate);
  const { context, scale, toCanvas } = view;
  drawPlate(view, plate);
  // The twin has no rim: its path is clipped at the plate.
  context.save();
  context.beginPath();
  context.rect(...toCanvas(-plate.length / 2, plate.width / 2), plate.length * scale, plate.width * scale);
  context.clip();
  for (const layer of LAYERS) drawPath(view, layer, moment);
  for (const layer of LAYERS) {
    const ball = ballAt(moment.buffer, layer.column, moment.t);
    if (ball) drawBall(view, layer, ball, Math.max(ballRadius(asset) * scale, MIN_RADIUS));
  }
  context.restore();
  context.setLineDash([]);
  drawServos(view, plate);
}

function drawBall({ context, toCanvas }: PlanView, layer: Layer, ball: PlanePoint, radius: number): void {
  context.beginPath();
  context.arc(...toCanvas(ball.x, ball.y), radius, 0, 2 * Math.PI);
  context.globalAlpha = layer.opacity;
  context.fillStyle = colour(layer.colour);
  context.fill();
  context.globalAlpha = 1;
}

function drawPath({ context, toCanvas }: PlanView, layer: Layer, { buffer, t, tail }: TraceMoment): void {
  context.strokeStyle = colour(layer.colour);
  context.lineWidth = 1.5;
  context.setLineDash([...layer.dash]);
  context.beginPath();
  // The line has a gap where the position is missing.
  let isContinued = false;
  for (let i = buffer.index(t - tail); i <= buffer.index(t); i++) {
    const x = buffer.x[layer.column][i];
    const y = buffer.y[layer.column][i];
    const isSeen = x != null && y != null;
    if (isSeen && isContinued) context.lineTo(...toCanvas(x, y));
    else if (isSeen) context.moveTo(...toCanvas(x, y));
    isContinued = isSeen;
  }
  context.stroke();
}
