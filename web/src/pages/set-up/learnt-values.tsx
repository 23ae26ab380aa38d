import type { AxisCalibration, Calibration } from "../../api/types";
import { count, degrees, millimetres, number } from "../../words/numbers";
import { AxisTable, type AxisRow } from "./axis-table";

const milliseconds = (s: number) => number(s * 1e3, 0, "ms");

const ROWS: AxisRow<AxisCalibration>[] = [
  ["Gain: measured over modelled acceleration", (axis) => number(axis.gain, 3)],
  ["Dead time of the servo", (axis) => milliseconds(axis.dead_time_s)],
  ["Time constant of the servo", (axis) => milliseconds(axis.lag_s)],
  ["Plate angle at command 0", (axis) => degrees(axis.level_rad, 2)],
  ["Noise of the readings", (axis) => millimetres(axis.noise_m, 2)],
  [
    "Tilt at which a resting ball starts",
    (axis) => (axis.rest_s ? degrees(axis.breakaway_rad, 2) : "unknown"),
  ],
  ["Residual of a healthy rig, rms", (axis) => number(axis.residual_m_s2, 3, "m/s²")],
];

export function LearntValues({ calibration: { samples, x, y } }: { calibration: Calibration }) {
  return <AxisTable caption={`From ${count(samples)} samples`} rows={ROWS} x={x} y={y} />;
}
