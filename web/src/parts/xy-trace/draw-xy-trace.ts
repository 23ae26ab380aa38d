/** Draws the ball's way over the plate seen from above. */
import type { Asset } from "../../api/types";
import type { TraceBuffer } from "../../live/buffer";
import { ballAt, type PlanePoint } from "../../live/pose";
import { ballRadius, plateSize } from "../../live/rig-size";
import { colour } from "../../theme";
import { drawPlate } from "./draw-plate";
import { planView, type PlanView } from "./plan-view";

export interface TraceMoment {
  buffer: TraceBuffer;
  /** The moment up to which the way is drawn, s. */
  t: number;
  /** How long a way is drawn, s. */
  tail: number;
}

/** The twin first, so that what was measured lies above it. */
const LAYERS = [
  { column: "twinPosition", colour: "twin", dash: [5, 3], opacity: 0.45 },
  { column: "position", colour: "measured", dash: [], opacity: 1 },
] as const;

type Layer = (typeof LAYERS)[number];

/** A smaller ball would not be seen, px. */
const LEAST_RADIUS = 4;

export function drawXyTrace(canvas: HTMLCanvasElement, asset: Asset, moment: TraceMoment): void {
  const plate = plateSize(asset);
  const view = planView(canvas, plate);
  const { context, scale, place } = view;
  drawPlate(view, plate);
  // The twin knows no rim; what lies beyond the plate is left out.
  context.save();
  context.beginPath();
  context.rect(...place(-plate.length / 2, plate.width / 2), plate.length * scale, plate.width * scale);
  context.clip();
  for (const layer of LAYERS) drawWay(view, layer, moment);
  for (const layer of LAYERS) {
    const ball = ballAt(moment.buffer, layer.column, moment.t);
    if (ball) drawBall(view, layer, ball, Math.max(ballRadius(asset) * scale, LEAST_RADIUS));
  }
  context.restore();
}

function drawBall({ context, place }: PlanView, layer: Layer, ball: PlanePoint, radius: number): void {
  context.beginPath();
  context.arc(...place(ball.x, ball.y), radius, 0, 2 * Math.PI);
  context.globalAlpha = layer.opacity;
  context.fillStyle = colour(layer.colour);
  context.fill();
  context.globalAlpha = 1;
}

function drawWay({ context, place }: PlanView, layer: Layer, { buffer, t, tail }: TraceMoment): void {
  context.strokeStyle = colour(layer.colour);
  context.lineWidth = 1.5;
  context.setLineDash([...layer.dash]);
  context.beginPath();
  // Whether the line goes on from the moment before: it has a gap where no ball was seen.
  let goesOn = false;
  for (let i = buffer.index(t - tail); i <= buffer.index(t); i++) {
    const x = buffer.x[layer.column][i];
    const y = buffer.y[layer.column][i];
    const isSeen = x != null && y != null;
    if (isSeen && goesOn) context.lineTo(...place(x, y));
    else if (isSeen) context.moveTo(...place(x, y));
    goesOn = isSeen;
  }
  context.stroke();
}
