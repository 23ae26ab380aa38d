import type { PlateSize } from "../../live/rig-size";
import { colour } from "../../theme";
import type { PlanView } from "./plan-view";
import { servoArrows, type ServoArrow } from "./servo-arrows";

/** Draws the outline of the plate, and its axes through the centre. */
export function drawPlate(view: PlanView, plate: PlateSize): void {
  const { context, scale, toCanvas } = view;
  const { length, width, isRound } = plate;
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

/** Draws which servo moves the ball which way, above what is there. */
export function drawServos(view: PlanView, plate: PlateSize): void {
  for (const arrow of servoArrows(plate, view.toCanvas)) drawServo(view, arrow);
}

/** Half of the width of an arrowhead, which is as long as it is wide, px. */
const HEAD = 4;

/** Draws which way a positive command of a servo moves the ball. */
function drawServo({ context }: PlanView, { from, to, label }: ServoArrow): void {
  const [x, y] = to;
  const along = Math.hypot(x - from[0], y - from[1]);
  const [ux, uy] = [(x - from[0]) / along, (y - from[1]) / along];
  context.strokeStyle = context.fillStyle = colour("command");
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(...from);
  context.lineTo(x - HEAD * ux, y - HEAD * uy);
  context.stroke();
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(x - 2 * HEAD * ux + HEAD * uy, y - 2 * HEAD * uy - HEAD * ux);
  context.lineTo(x - 2 * HEAD * ux - HEAD * uy, y - 2 * HEAD * uy + HEAD * ux);
  context.fill();
  context.font = "12px system-ui, sans-serif";
  const at = [x + 1.5 * HEAD, y + HEAD] as const;
  // An edge in the colour of the plate, so that the label can be read on the path of the ball.
  context.lineWidth = 4;
  context.lineJoin = "round";
  context.strokeStyle = colour("plate");
  context.strokeText(label, ...at);
  context.fillText(label, ...at);
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
