/** The quantities of a recording, their titles and units. */

export const QUANTITIES = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"] as const;
export type Quantity = (typeof QUANTITIES)[number];

export const QUANTITY_TITLES: Record<Quantity, string> = {
  t_s: "Time",
  cmd_qx_rad: "Command qx (about x)",
  cmd_qy_rad: "Command qy (about y)",
  x_m: "Ball x",
  y_m: "Ball y",
};

export interface Unit {
  word: string;
  /** Factor from this unit to that of the session file. */
  factor: number;
}

const TIME: Unit[] = [
  { word: "s", factor: 1 },
  { word: "ms", factor: 1e-3 },
  { word: "µs", factor: 1e-6 },
];
const ANGLE: Unit[] = [
  { word: "rad", factor: 1 },
  { word: "°", factor: Math.PI / 180 },
  { word: "mrad", factor: 1e-3 },
];
const LENGTH: Unit[] = [
  { word: "m", factor: 1 },
  { word: "mm", factor: 1e-3 },
  { word: "cm", factor: 1e-2 },
  { word: "in", factor: 0.0254 },
];

export const UNITS: Record<Quantity, Unit[]> = {
  t_s: TIME,
  cmd_qx_rad: ANGLE,
  cmd_qy_rad: ANGLE,
  x_m: LENGTH,
  y_m: LENGTH,
};
