/** Puts recordings on a common time axis. */
import type { FaultLine, Trace } from "../../api/types";
import { faultMark } from "../../parts/charts/fault-marks";
import type { ChartData } from "../../parts/charts/line-chart";
import type { Mark } from "../../parts/charts/overlays";

/** Returns the trace with its first moment at `start`, s. */
export function alignedTrace(trace: Trace, start: number): Trace {
  const first = trace.t_s[0] ?? 0;
  return { ...trace, t_s: trace.t_s.map((t) => t - first + start) };
}

/** Returns the marks of the faults of a recording whose first moment, `first`, is at `start`. */
export const alignedMarks = (faults: FaultLine[], first: number, start: number): Mark[] =>
  faults.map((line) => ({ ...faultMark(line), t: line.t_s - first + start }));

/** Returns the range that contains the moments of both traces; undefined if both are empty. */
export function commonRange(...traces: Trace[]): [number, number] | undefined {
  const ends = traces.flatMap(({ t_s }) => (t_s.length ? [t_s[0]!, t_s[t_s.length - 1]!] : []));
  return ends.length ? [Math.min(...ends), Math.max(...ends)] : undefined;
}

/** Returns the values of all lines at the time `at`; each line has its own moments in `data`. */
export function valuesAt([t, ...lines]: ChartData, at: number): (number | null | undefined)[] {
  let last = t.length - 1;
  while (last > 0 && t[last]! > at) last--;
  return lines.map((line) => {
    let i = last;
    while (i > 0 && line[i] === undefined) i--;
    return line[i];
  });
}

/** Longest time between two values over which a line is drawn through them, s. */
const MAX_STEP_S = 1;

type Curve = [number[], (number | null)[]];

/** Returns the value of a curve at the time `at`; null beyond its values and in their gaps. */
function interpolated([t, values]: Curve, at: number, after: number): number | null {
  const [to, end] = [values[after], t[after]];
  if (to == null || end === undefined || end - at > MAX_STEP_S) return null;
  if (end === at) return to;
  const [from, start] = [values[after - 1], t[after - 1]];
  if (from == null || start === undefined || end - start > MAX_STEP_S) return null;
  return from + ((to - from) * (at - start)) / (end - start);
}

/** Returns the first curve minus the second one, at the moments of the first. */
export function difference([t, values]: Curve, other: Curve): Curve {
  let after = 0;
  const at = (moment: number, i: number) => {
    while (after < other[0].length && other[0][after]! < moment) after++;
    const [value, subtracted] = [values[i], interpolated(other, moment, after)];
    return value == null || subtracted === null ? null : value - subtracted;
  };
  return [t, t.map(at)];
}

export interface CompareAddress {
  a?: string;
  b?: string;
  /** How much later the second recording begins than the first, s. */
  shift: number;
}

/** Reads the query of the page's address. */
export function readCompare(query: URLSearchParams): CompareAddress {
  const shift = Number(query.get("shift") ?? 0);
  return {
    a: query.get("a") || undefined,
    b: query.get("b") || undefined,
    shift: Number.isFinite(shift) ? shift : 0,
  };
}
