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

const RESIDUAL = "Residual";
const EVIDENCE = "Weight of evidence for a servo fault";
const PATH = "Deviation from the twin's path over 2 s, RMS";

/** Evidence from which a servo is suspected with the default settings, nats. */
const SUSPECT_NATS = 10;

const ROWS: [name: string, text: (axis: AxisEvidence) => string][] = [
  ["Command", (axis) => degrees(axis.command_rad, 2)],
  ["Position", (axis) => millimetres(axis.position_m)],
  ["Velocity", (axis) => number(axis.velocity_m_s, 3, "m/s")],
  ["Measured acceleration", (axis) => acceleration(axis.measured_m_s2)],
  ["Twin's acceleration", (axis) => acceleration(axis.twin_m_s2)],
  [RESIDUAL, (axis) => acceleration(axis.residual_m_s2)],
  ["Limit", (axis) => acceleration(axis.limit_m_s2)],
  ["Gate", (axis) => (axis.enabled ? "open" : "closed")],
  [EVIDENCE, (axis) => number(axis.nats, 1, "nats")],
  [PATH, (axis) => millimetres(axis.path_error_m)],
  ["Largest deviation of a healthy rig", (axis) => millimetres(axis.path_limit_m)],
];

/** A value with its standard error. */
const estimate = (value: number, error: number, digits: number, unit = "") =>
  `${number(value, digits)} ± ${number(error, digits, unit)}`;

/** Estimates of the servo's response along an axis. */
const ANSWER_ROWS: [name: string, text: (answer: Answer) => string][] = [
  ["Response, % of the command", (a) => estimate(100 * a.gain, 100 * a.gain_error, 0, "%")],
  ["Unexplained acceleration", (a) => estimate(a.offset_m_s2, a.offset_error_m_s2, 2, "m/s²")],
  ["Additional delay", (a) => estimate(a.delay_s * 1e3, a.delay_error_s * 1e3, 0, "ms")],
];

/** Whether a value speaks for a fault: these are what a verdict on a servo is based on. */
const SPEAKS_FOR_FAULT: Record<string, (axis: AxisEvidence) => boolean> = {
  [RESIDUAL]: (axis) => axis.enabled && Math.abs(axis.residual_m_s2 ?? 0) >= axis.limit_m_s2,
  [EVIDENCE]: (axis) => (axis.nats ?? 0) >= SUSPECT_NATS,
  [PATH]: (axis) =>
    axis.path_error_m != null && axis.path_limit_m != null && axis.path_error_m > axis.path_limit_m,
};

export function evidenceRows({ x, y }: Evidence): { name: string; cells: Cell[] }[] {
  const axes = [x, y];
  const rows = ROWS.map(([name, text]) => ({
    name,
    cells: axes.map((axis) => ({
      text: text(axis),
      isBeyondLimit: SPEAKS_FOR_FAULT[name]?.(axis) ?? false,
    })),
  }));
  if (!axes.some((axis) => axis.answer)) return rows;
  const answers = ANSWER_ROWS.map(([name, text]) => ({
    name,
    cells: axes.map(({ answer }) => ({ text: answer ? text(answer) : NONE, isBeyondLimit: false })),
  }));
  return [...rows, ...answers];
}
