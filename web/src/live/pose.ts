/** What the three-dimensional view shows of a moment. */
import type { TraceBuffer } from "./buffer";

export interface PlanePoint {
  x: number;
  y: number;
}

export interface Pose {
  /** Plate angles about x and y, rad. */
  qx: number;
  qy: number;
  ball: PlanePoint | null;
  /** Where the twin has the ball. */
  ghost: PlanePoint | null;
}

/** Where the ball, or the twin's, is at `t` on the plate, m. */
export function ballAt(
  buffer: TraceBuffer,
  column: "position" | "twinPosition",
  t: number,
): PlanePoint | null {
  const x = buffer.at("x", column, t);
  const y = buffer.at("y", column, t);
  return x === null || y === null ? null : { x, y };
}

/** The ball moves along x by the plate's turning about y, and along y by that about x. */
export const poseAt = (buffer: TraceBuffer, t: number): Pose => ({
  qx: buffer.at("y", "plate", t) ?? 0,
  qy: buffer.at("x", "plate", t) ?? 0,
  ball: ballAt(buffer, "position", t),
  ghost: ballAt(buffer, "twinPosition", t),
});
