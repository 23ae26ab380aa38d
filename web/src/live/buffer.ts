/** A growing trace as columns, for charts and drawings; the oldest moments are dropped. */
import type { Axis, Trace } from "../api/types";
import {
  appendShared,
  appendTrace,
  dropOldest,
  emptyColumns,
  emptyShared,
  type NumberColumn,
} from "./axis-columns";

export const AXES: readonly Axis[] = ["x", "y"];

/** Number of moments that are kept: 100 s at 100 Hz. */
const CAPACITY = 10_000;

export class TraceBuffer {
  t: number[] = [];
  x = emptyColumns();
  y = emptyColumns();
  shared = emptyShared();

  /** Returns a buffer with a whole trace, of which nothing is dropped. */
  static of(trace: Trace): TraceBuffer {
    const buffer = new TraceBuffer(Infinity);
    buffer.append(trace);
    return buffer;
  }

  constructor(private readonly capacity = CAPACITY) {}

  get first(): number {
    return this.t[0] ?? 0;
  }

  get last(): number {
    return this.t[this.t.length - 1] ?? 0;
  }

  clear(): void {
    this.t = [];
    this.x = emptyColumns();
    this.y = emptyColumns();
    this.shared = emptyShared();
  }

  /**
   * Appends the first moments that came over a new connection, which may be there already. If others between are
   * missing, only the new ones are kept: a line across a hole would not be a measurement.
   */
  resume(trace: Trace): void {
    if (trace.t_s[0]! > this.last) this.clear();
    this.append(trace);
  }

  /** Appends the moments that are later than those that are there. */
  append(trace: Trace): void {
    const end = trace.t_s.length;
    const first = this.t.length ? trace.t_s.findIndex((t) => t > this.last) : 0;
    const begin = first < 0 ? end : first;
    for (let i = begin; i < end; i++) this.t.push(trace.t_s[i]!);
    for (const axis of AXES) appendTrace(this[axis], trace[axis], begin, end);
    appendShared(this.shared, trace, begin, end);
    // Dropping moves all columns, so it is done only for a tenth of the capacity at once.
    const over = this.t.length - this.capacity;
    if (over > this.capacity / 10) this.drop(over);
  }

  private drop(n: number): void {
    this.t.splice(0, n);
    for (const axis of AXES) dropOldest(this[axis], n);
    dropOldest(this.shared, n);
  }

  /** Returns the index of the last moment not after `t`, or 0 if all moments are after `t`. */
  index(t: number): number {
    let low = 0;
    let high = this.t.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.t[middle]! <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** Returns the value of a column at `t`, linearly interpolated; null if the value is missing. */
  at(axis: Axis, name: NumberColumn, t: number): number | null {
    const column = this[axis][name];
    const i = this.index(t);
    const here = column[i] ?? null;
    const next = column[i + 1] ?? null;
    if (here === null || next === null) return here;
    const fraction = (t - this.t[i]!) / (this.t[i + 1]! - this.t[i]!);
    return here + (next - here) * Math.min(Math.max(fraction, 0), 1);
  }
}
