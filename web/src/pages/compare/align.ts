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
