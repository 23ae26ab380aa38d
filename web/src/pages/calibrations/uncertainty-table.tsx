import type { AxisCalibration, Calibration } from "../../api/types";
import { degrees, number, plural } from "../../words/numbers";
import { AxisTable, type AxisRow } from "../set-up/axis-table";

const ROWS: AxisRow<AxisCalibration>[] = [
  ["Gain, from session to session", ({ gain_spread: spread }) => number((spread ?? 0) * 100, 1, "%")],
  ["Plate angle at command 0, from session to session", (axis) => degrees(axis.level_spread_rad ?? 0, 2)],
  ["Acceleration that the twin does not explain", (axis) => number(axis.model_error_m_s2, 3, "m/s²")],
];

/** The standard deviations of what was learnt. */
export function UncertaintyTable({ calibration: { sessions, x, y } }: { calibration: Calibration }) {
  const n = sessions?.length ?? 0;
  const caption = n ? `Standard deviation, over ${plural(n, "session")}` : "Standard deviation";
  return <AxisTable caption={caption} rows={ROWS} x={x} y={y} />;
}
