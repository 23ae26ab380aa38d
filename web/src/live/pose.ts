/** The pose of plate and ball at one moment, for the 3D view. */
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
  /** The twin's ball. */
  ghost: PlanePoint | null;
}

/** Returns the position of the ball, or of the twin's ball, on the plate at `t`, m. */
export function ballAt(
  buffer: TraceBuffer,
  column: "position" | "twinPosition",
  t: number,
): PlanePoint | null {
  const x = buffer.at("x", column, t);
  const y = buffer.at("y", column, t);
  return x === null || y === null ? null : { x, y };
}

/** Returns the pose at `t`. The plate's angle about y (qy) moves the ball along x, that about x (qx) along y. */
export const poseAt = (buffer: TraceBuffer, t: number): Pose => ({
  qx: buffer.at("y", "plate", t) ?? 0,
  qy: buffer.at("x", "plate", t) ?? 0,
  ball: ballAt(buffer, "position", t),
  ghost: ballAt(buffer, "twinPosition", t),
});
