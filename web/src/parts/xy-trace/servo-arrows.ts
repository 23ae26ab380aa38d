/**
 * Which way a positive command of each servo moves the ball, in the plate frame. Axes, signs and units of an asset
 * file turn the device's readings into this frame before they are drawn, and never the sign of a command.
 */
import type { PlanePoint } from "../../live/pose";
import type { PlateSize } from "../../live/rig-size";

type CanvasPoint = [number, number];

export interface ServoArrow {
  label: string;
  from: CanvasPoint;
  to: CanvasPoint;
}

/** +qy moves the ball toward +x, +qx toward −y. */
const SERVOS: { label: string; towards: PlanePoint }[] = [
  { label: "X servo, +qy", towards: { x: 1, y: 0 } },
  { label: "Y servo, +qx", towards: { x: 0, y: -1 } },
];

/** Distance of the arrows from the corner of the plate, and their length, px. */
const INSET = 12;
const LENGTH = 26;

/** Returns an arrow for each servo, from a point near the upper left corner of the plate. */
export function servoArrows(
  { length, width }: PlateSize,
  toCanvas: (x: number, y: number) => CanvasPoint,
): ServoArrow[] {
  const [left, top] = toCanvas(-length / 2, width / 2);
  const from: CanvasPoint = [left + INSET, top + INSET];
  return SERVOS.map(({ label, towards: { x, y } }) => ({
    label,
    from,
    // The y of a canvas increases downward.
    to: [from[0] + LENGTH * x, from[1] - LENGTH * y],
  }));
}
