/** The evidence at one moment as rows of a table with a column for each axis. */
import type { Axis, Evidence, Thresholds } from "../../api/types";
import { AXES } from "../../live/buffer";
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
const PATH = "Evidence of the path";

const ROWS: [name: string, text: (axis: AxisEvidence) => string][] = [
  ["Command", (axis) => degrees(axis.command_rad, 2)],
  ["Position", (axis) => millimetres(axis.position_m)],
  ["Velocity", (axis) => number(axis.velocity_m_s, 3, "m/s")],
  ["Measured acceleration", (axis) => acceleration(axis.measured_m_s2)],
  ["Twin's acceleration", (axis) => acceleration(axis.twin_m_s2)],
  [RESIDUAL, (axis) => acceleration(axis.residual_m_s2)],
  ["Limit", (axis) => acceleration(axis.limit_m_s2)],
  ["Judged", (axis) => (axis.enabled ? "yes" : "no")],
  [EVIDENCE, (axis) => number(axis.nats, 1, "nats")],
  [PATH, (axis) => number(axis.path_nats, 1, "nats")],
  ["Limit of that evidence", (axis) => number(axis.path_limit_nats, 1, "nats")],
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

/**
 * Whether a value speaks for a fault: these are what a verdict on a servo is based on. `suspect` is the evidence
 * from which the servo of the axis was suspected, nats, if evidence decided.
 */
const SPEAKS_FOR_FAULT: Record<string, (axis: AxisEvidence, suspect?: number | null) => boolean> = {
  [RESIDUAL]: (axis) => axis.enabled && Math.abs(axis.residual_m_s2 ?? 0) >= axis.limit_m_s2,
  [EVIDENCE]: (axis, suspect) => suspect != null && (axis.nats ?? 0) >= suspect,
  [PATH]: (axis) =>
    axis.path_nats != null && axis.path_limit_nats != null && axis.path_nats >= axis.path_limit_nats,
};

/** The values at which the monitor of the servo along an axis decided. */
const ofServo = (thresholds: Thresholds[], axis: Axis) =>
  thresholds.find(({ code }) => code === `${axis}_servo`);

/** Returns the rows; `thresholds` are the values at which the monitors decided, as far as they are known. */
export function evidenceRows(
  { x, y }: Evidence,
  thresholds: Thresholds[] = [],
): { name: string; cells: Cell[] }[] {
  const axes = [x, y];
  const suspect = AXES.map((axis) => ofServo(thresholds, axis)?.suspect_nats);
  const rows = ROWS.map(([name, text]) => ({
    name,
    cells: axes.map((axis, i) => ({
      text: text(axis),
      isBeyondLimit: SPEAKS_FOR_FAULT[name]?.(axis, suspect[i]) ?? false,
    })),
  }));
  if (!axes.some((axis) => axis.answer)) return rows;
  const answers = ANSWER_ROWS.map(([name, text]) => ({
    name,
    cells: axes.map(({ answer }) => ({ text: answer ? text(answer) : NONE, isBeyondLimit: false })),
  }));
  return [...rows, ...answers];
}

const nats = (value: number) => `${Number(value.toFixed(1))}`;

/** From which weight of evidence on servos were suspected and confirmed, as a sentence. */
export function decisiveNats(thresholds?: Thresholds[]): string {
  if (!thresholds) return "From which weight of evidence on a servo was suspected is not known any more.";
  const texts = AXES.flatMap((axis) => {
    const { suspect_nats: suspect, confirm_nats: confirm } = ofServo(thresholds, axis) ?? {};
    return suspect == null || confirm == null
      ? []
      : [`${nats(suspect)}\u202fnats and more (confirmed from ${nats(confirm)})`];
  });
  const [x, y] = texts;
  if (!x) return "The weight of evidence did not decide.";
  const both = y && x !== y ? `${x} along x and ${y} along y` : x;
  return `A weight of evidence of ${both} is red, too.`;
}
