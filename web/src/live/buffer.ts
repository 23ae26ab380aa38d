/** A growing trace as flat columns, for charts and pictures; the oldest go first. */
import type { Around, Axis, Trace } from "../api/types";

export const AXES: readonly Axis[] = ["x", "y"];

type Column = (number | null)[];

export interface AxisColumns {
  command: Column;
  plate: Column;
  position: Column;
  twinPosition: Column;
  measured: Column;
  twin: Column;
  residual: Column;
  limit: Column;
  limitBelow: Column;
  enabled: boolean[];
}

const axis = (): AxisColumns => ({
  command: [],
  plate: [],
  position: [],
  twinPosition: [],
  measured: [],
  twin: [],
  residual: [],
  limit: [],
  limitBelow: [],
  enabled: [],
});

/** Moments that are kept: far more than a screen is wide, 100 s at 100 Hz. */
const MOST = 10_000;

const minus = (a: number | null | undefined, b: number | null | undefined) =>
  a === null || a === undefined || b === null || b === undefined ? null : a - b;

/** Longest time in which nothing is judged that lines go across, s. */
const ACROSS_S = 0.2;

/** The rows of a recording that were judged, and others where none was for a while. */
function drawable(columns: Around["columns"]): Around["columns"] {
  let last = -Infinity;
  const kept = columns.t_s.flatMap((t, i) => {
    const judged = columns.x_limit_m_s2[i] != null;
    if (!judged && t - last < ACROSS_S) return [];
    last = t;
    return [i];
  });
  return Object.fromEntries(
    Object.entries(columns).map(([name, column]) => [name, kept.map((i) => column[i])]),
  ) as Around["columns"];
}

export class TraceBuffer {
  t: number[] = [];
  x = axis();
  y = axis();

  static of(trace: Trace): TraceBuffer {
    const buffer = new TraceBuffer(Infinity);
    buffer.append(trace);
    return buffer;
  }

  /** The seconds around a fault: they say nothing of where the twin was. */
  static ofRecording({ columns }: Around): TraceBuffer {
    const c = drawable(columns);
    const none = c.t_s.map(() => null);
    const trace = (
      command: Column,
      position: Column,
      measured: Column,
      twin: Column,
      limit: Column,
      enabled: (boolean | null)[],
    ) => ({
      command_rad: command,
      plate_angle_rad: none,
      position_m: position,
      twin_position_m: none,
      measured_m_s2: measured,
      twin_m_s2: twin,
      limit_m_s2: limit,
      enabled: enabled.map(Boolean),
    });
    return TraceBuffer.of({
      t_s: c.t_s,
      x: trace(c.cmd_qy_rad, c.x_m, c.x_measured_m_s2, c.x_twin_m_s2, c.x_limit_m_s2, c.x_enabled),
      y: trace(c.cmd_qx_rad, c.y_m, c.y_measured_m_s2, c.y_twin_m_s2, c.y_limit_m_s2, c.y_enabled),
    } as unknown as Trace);
  }

  constructor(private readonly most = MOST) {}

  get first(): number {
    return this.t[0] ?? 0;
  }
  get last(): number {
    return this.t[this.t.length - 1] ?? 0;
  }

  clear(): void {
    this.t = [];
    this.x = axis();
    this.y = axis();
  }

  append(trace: Trace): void {
    for (let i = 0; i < trace.t_s.length; i++) this.t.push(trace.t_s[i]!);
    for (const name of AXES) {
      const from = trace[name],
        to = this[name];
      for (let i = 0; i < trace.t_s.length; i++) {
        const limit = from.limit_m_s2[i] ?? null;
        to.command.push(from.command_rad[i] ?? null);
        to.plate.push(from.plate_angle_rad[i] ?? null);
        to.position.push(from.position_m[i] ?? null);
        to.twinPosition.push(from.position_m[i] == null ? null : (from.twin_position_m[i] ?? null));
        to.measured.push(from.measured_m_s2[i] ?? null);
        to.twin.push(from.twin_m_s2[i] ?? null);
        to.residual.push(minus(from.measured_m_s2[i], from.twin_m_s2[i]));
        to.limit.push(limit);
        to.limitBelow.push(limit === null ? null : -limit);
        to.enabled.push(from.enabled[i] ?? false);
      }
    }
    const over = this.t.length - this.most;
    if (over > this.most / 10) this.drop(over);
  }

  private drop(n: number): void {
    this.t.splice(0, n);
    for (const name of AXES)
      (Object.values(this[name]) as unknown[][]).forEach((column) => column.splice(0, n));
  }

  /** The index of the last moment not after `t`. */
  index(t: number): number {
    let low = 0,
      high = this.t.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.t[middle]! <= t) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** A column's value at `t`, between its moments along a line. */
  at(name: Axis, key: Exclude<keyof AxisColumns, "enabled">, t: number): number | null {
    const column = this[name][key];
    const i = this.index(t);
    const here = column[i] ?? null;
    const next = column[i + 1] ?? null;
    if (here === null || next === null) return here;
    const share = (t - this.t[i]!) / (this.t[i + 1]! - this.t[i]!);
    return here + (next - here) * Math.min(Math.max(share, 0), 1);
  }
}

/**
 * The clock by which live pictures are shown: it follows the device's clock
 * smoothly, a little behind, so that batches that come in bursts move evenly.
 */
export class PlayoutClock {
  private shown = NaN;
  private before = NaN;

  /** Seconds behind the newest moment; more than a demo's batch is long. */
  constructor(private readonly behind = 0.25) {}

  tick(now: number, newest: number): number {
    const dt = Number.isNaN(this.before) ? 0 : (now - this.before) / 1000;
    this.before = now;
    const target = newest - this.behind;
    const off = target - this.shown;
    if (Number.isNaN(off) || Math.abs(off) > 2) this.shown = target;
    else this.shown = Math.min(this.shown + dt * (1 + Math.min(Math.max(off, -0.5), 0.5)), newest);
    return this.shown;
  }
}
