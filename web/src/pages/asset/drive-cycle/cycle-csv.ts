import type { DriveCycle } from "../../../api/types";

const COLUMNS = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"] as const;

/** The set points of a drive cycle as CSV: numbers and fixed names, none of which needs quotes. */
export function cycleCsv({ rows }: Pick<DriveCycle, "rows">): string {
  const lines = rows.t_s.map((_, i) => COLUMNS.map((name) => rows[name][i] ?? "").join(","));
  return [COLUMNS.join(","), ...lines].join("\n") + "\n";
}
