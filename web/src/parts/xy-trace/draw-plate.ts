import type { PlateSize } from "../../live/rig-size";
import { colour } from "../../theme";
import type { PlanView } from "./plan-view";

/** Draws the outline of the plate and its axes through the centre. */
export function drawPlate(view: PlanView, { length, width, isRound }: PlateSize): void {
  const { context, scale, toCanvas } = view;
  context.strokeStyle = colour("edge");
  context.fillStyle = colour("plate");
  context.lineWidth = 1.5;
  context.setLineDash([]);
  context.beginPath();
  if (isRound) context.arc(...toCanvas(0, 0), (length / 2) * scale, 0, 2 * Math.PI);
  else context.rect(...toCanvas(-length / 2, width / 2), length * scale, width * scale);
  context.fill();
  context.stroke();
  drawAxes(view, length, width);
}

function drawAxes({ context, toCanvas }: PlanView, length: number, width: number): void {
  context.lineWidth = 1;
  context.strokeStyle = colour("grid");
  context.beginPath();
  context.moveTo(...toCanvas(-length / 2, 0));
  context.lineTo(...toCanvas(length / 2, 0));
  context.moveTo(...toCanvas(0, -width / 2));
  context.lineTo(...toCanvas(0, width / 2));
  context.stroke();
  context.fillStyle = colour("quiet");
  context.font = "12px system-ui, sans-serif";
  const [right, middle] = toCanvas(length / 2, 0);
  context.fillText("x", right - 12, middle - 5);
  const [centre, top] = toCanvas(0, width / 2);
  context.fillText("y", centre + 5, top + 13);
}
