import type { DriveCycle } from "../../../api/types";

const COLUMNS = ["t_s", "cmd_qx_rad", "cmd_qy_rad", "x_m", "y_m"] as const;

/** Returns the set points of a drive cycle as CSV; numbers and column names need no quotes. */
export function cycleCsv({ rows }: Pick<DriveCycle, "rows">): string {
  const lines = rows.t_s.map((_, i) => COLUMNS.map((name) => rows[name][i] ?? "").join(","));
  return [COLUMNS.join(","), ...lines].join("\n") + "\n";
}
