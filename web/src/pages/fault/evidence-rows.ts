/** The evidence at one moment as rows of a table with a column for each axis. */
import type { Evidence } from "../../api/types";
import { degrees, millimetres, NONE, number } from "../../words/numbers";

type AxisEvidence = Evidence["x"];
type Answer = NonNullable<AxisEvidence["answer"]>;

interface Cell {
  text: string;
  isBeyondLimit: boolean;
}

const acceleration = (value?: number | null) => number(value, 3, "m/s²");

const ROWS: [name: string, text: (axis: AxisEvidence) => string][] = [
  ["Command", (axis) => degrees(axis.command_rad, 2)],
  ["Position", (axis) => millimetres(axis.position_m)],
  ["Velocity", (axis) => number(axis.velocity_m_s, 3, "m/s")],
  ["Measured acceleration", (axis) => acceleration(axis.measured_m_s2)],
  ["Twin's acceleration", (axis) => acceleration(axis.twin_m_s2)],
  ["Residual", (axis) => acceleration(axis.residual_m_s2)],
  ["Limit", (axis) => acceleration(axis.limit_m_s2)],
  ["Gate", (axis) => (axis.enabled ? "open" : "closed")],
  ["Evidence of a servo fault", (axis) => number(axis.nats, 1, "nats")],
  ["RMS deviation from the twin's path, 2 s", (axis) => millimetres(axis.path_error_m)],
];

/** A value with its standard error. */
const estimate = (value: number, error: number, digits: number, unit = "") =>
  `${number(value, digits)} ± ${number(error, digits, unit)}`;

/** Estimates of the servo's response along an axis. */
const ANSWER_ROWS: [name: string, text: (answer: Answer) => string][] = [
  ["Gain relative to the twin", (a) => estimate(a.gain, a.gain_error, 2)],
  [
    "Acceleration not explained by the command",
    (a) => estimate(a.offset_m_s2, a.offset_error_m_s2, 2, "m/s²"),
  ],
  ["Delay in addition to the twin's", (a) => estimate(a.delay_s * 1e3, a.delay_error_s * 1e3, 0, "ms")],
];

const isBeyondLimit = (axis: AxisEvidence) =>
  axis.enabled && Math.abs(axis.residual_m_s2 ?? 0) >= axis.limit_m_s2;

export function evidenceRows({ x, y }: Evidence): { name: string; cells: Cell[] }[] {
  const axes = [x, y];
  const rows = ROWS.map(([name, text]) => ({
    name,
    cells: axes.map((axis) => ({
      text: text(axis),
      isBeyondLimit: name === "Residual" && isBeyondLimit(axis),
    })),
  }));
  if (!axes.some((axis) => axis.answer)) return rows;
  const answers = ANSWER_ROWS.map(([name, text]) => ({
    name,
    cells: axes.map(({ answer }) => ({ text: answer ? text(answer) : NONE, isBeyondLimit: false })),
  }));
  return [...rows, ...answers];
}
