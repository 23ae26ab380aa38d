/** The quantities along one axis as columns of equal length, with one value per moment. */
import type { Trace } from "../api/types";

export type Column = (number | null)[];

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
  /** Fault detection counter of the servo's monitor, −128 to 127. */
  counter: Column;
  /** Evidence against the servo, nats. */
  nats: Column;
  enabled: boolean[];
}

export type NumberColumn = Exclude<keyof AxisColumns, "enabled">;

export const emptyColumns = (): AxisColumns => ({
  command: [],
  plate: [],
  position: [],
  twinPosition: [],
  measured: [],
  twin: [],
  residual: [],
  limit: [],
  limitBelow: [],
  counter: [],
  nats: [],
  enabled: [],
});

const difference = (a: number | null | undefined, b: number | null | undefined) =>
  a == null || b == null ? null : a - b;

/** Appends the moments `begin` to `end` of a trace along one axis. */
export function appendTrace(to: AxisColumns, from: Trace["x"], begin: number, end: number): void {
  for (let i = begin; i < end; i++) {
    const limit = from.limit_m_s2[i] ?? null;
    to.command.push(from.command_rad[i] ?? null);
    to.plate.push(from.plate_angle_rad[i] ?? null);
    to.position.push(from.position_m[i] ?? null);
    // Without a measured position, the twin's position has no meaning.
    to.twinPosition.push(from.position_m[i] == null ? null : (from.twin_position_m[i] ?? null));
    to.measured.push(from.measured_m_s2[i] ?? null);
    to.twin.push(from.twin_m_s2[i] ?? null);
    to.residual.push(difference(from.measured_m_s2[i], from.twin_m_s2[i]));
    to.limit.push(limit);
    to.limitBelow.push(limit === null ? null : -limit);
    to.counter.push(from.counter[i] ?? null);
    to.nats.push(from.nats[i] ?? null);
    to.enabled.push(from.enabled[i] ?? false);
  }
}

/** The counters of the monitors that do not belong to an axis. */
export interface SharedColumns {
  stuckBall: Column;
  sensor: Column;
}

export type SharedColumn = keyof SharedColumns;

export const emptyShared = (): SharedColumns => ({ stuckBall: [], sensor: [] });

/** Appends the moments `begin` to `end` of what a trace has besides the axes. */
export function appendShared(to: SharedColumns, from: Trace, begin: number, end: number): void {
  for (let i = begin; i < end; i++) {
    to.stuckBall.push(from.stuck_ball_counter[i] ?? null);
    to.sensor.push(from.sensor_counter[i] ?? null);
  }
}

/** Removes the oldest `n` moments. */
export function dropOldest(columns: AxisColumns | SharedColumns, n: number): void {
  for (const column of Object.values(columns) as unknown[][]) column.splice(0, n);
}
