/** The dimensions of a rig in words, and whether they are the defaults of the service. */
import type { Asset } from "../api/types";
import { millimetres } from "./numbers";

/** The dimensions of a rig that is registered by its name alone; they are those of `PlateView` and `BallView`. */
export const DEFAULT_DIMENSIONS = dimensions({
  ball: { radius_m: 0.0127 },
  plate: { length_m: 0.38, width_m: 0.24 },
});

interface Dimensioned {
  ball?: Pick<NonNullable<Asset["ball"]>, "radius_m">;
  plate?: Pick<NonNullable<Asset["plate"]>, "diameter_m" | "length_m" | "width_m">;
}

/** Returns the dimensions of the ball and the plate. */
export function dimensions({ ball, plate }: Dimensioned): string {
  const radius = `ball radius ${millimetres(ball?.radius_m)}`;
  if (plate?.diameter_m) return `${radius}, round plate ${millimetres(plate.diameter_m, 0)}`;
  return `${radius}, plate ${millimetres(plate?.length_m, 0)} × ${millimetres(plate?.width_m, 0)}`;
}

/** Whether a rig has the default dimensions, which may never have been entered. */
export const hasDefaultDimensions = (asset: Dimensioned) => dimensions(asset) === DEFAULT_DIMENSIONS;
