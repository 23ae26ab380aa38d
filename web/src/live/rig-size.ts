/** Dimensions of a rig for drawings; missing ones are the service's defaults. */
import type { Asset } from "../api/types";

export interface PlateSize {
  /** Along x and y, m. */
  length: number;
  width: number;
  isRound: boolean;
}

export function plateSize({ plate }: Asset): PlateSize {
  const diameter = plate?.diameter_m;
  if (diameter) return { length: diameter, width: diameter, isRound: true };
  return { length: plate?.length_m ?? 0.38, width: plate?.width_m ?? 0.24, isRound: false };
}

export const ballRadius = ({ ball }: Asset) => ball?.radius_m ?? 0.0127;
