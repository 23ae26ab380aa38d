/** The quantities of a recording, their titles and the units in which columns may have them. */

export const QUANTITIES = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"] as const;
export type Quantity = (typeof QUANTITIES)[number];

export const QUANTITY_TITLES: Record<Quantity, string> = {
  t_s: "Time",
  cmd_qx_rad: "Command qx (about x)",
  cmd_qy_rad: "Command qy (about y)",
  x_m: "Ball x",
  y_m: "Ball y",
};

/** A unit as a mapping of columns writes it, and as people do. */
interface Unit {
  written: string;
  word: string;
}

const unit = (written: string, word = written): Unit => ({ written, word });

const ANGLE = [unit("rad"), unit("deg", "°"), unit("mrad")];
const LENGTH = [unit("m"), unit("mm"), unit("cm"), unit("in")];

export const UNITS: Record<Quantity, Unit[]> = {
  t_s: [unit("s"), unit("ms"), unit("us", "µs"), unit("ns")],
  cmd_qx_rad: ANGLE,
  cmd_qy_rad: ANGLE,
  x_m: LENGTH,
  y_m: LENGTH,
};
