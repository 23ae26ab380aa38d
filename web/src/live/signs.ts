/** Checks the signs and the order of the axes by comparing measured and twin accelerations. */
import type { AssetAxes, Axis } from "../api/types";
import type { TraceBuffer } from "./buffer";
import { correlation, judgeSign, type Correlations, type SignVerdict } from "./correlation";

export interface Signs {
  x: Correlations;
  y: Correlations;
  verdict: Record<Axis, SignVerdict>;
  /** Duration of the samples with enough acceleration to compare, s. */
  seconds: number;
}

/** Smallest acceleration of the twin that is compared, m/s²: about 1° of tilt. */
const MIN_ACCELERATION = 0.12;

/** Correlation of the measured acceleration along one axis with the twin's along the same or the other axis. */
function correlate(buffer: TraceBuffer, measuredAxis: Axis, twinAxis: Axis): number {
  const measured: number[] = [];
  const twin: number[] = [];
  buffer.t.forEach((_, i) => {
    const m = buffer[measuredAxis].measured[i];
    const t = buffer[twinAxis].twin[i];
    if (m == null || t == null) return;
    measured.push(m);
    twin.push(t);
  });
  return correlation(measured, twin);
}

export function compareSigns(buffer: TraceBuffer): Signs {
  const x = { own: correlate(buffer, "x", "x"), other: correlate(buffer, "x", "y") };
  const y = { own: correlate(buffer, "y", "y"), other: correlate(buffer, "y", "x") };
  const n = buffer.t.length;
  const period = n > 1 ? (buffer.last - buffer.first) / (n - 1) : 0;
  const twin = (axis: Axis, i: number) => Math.abs(buffer[axis].twin[i] ?? 0);
  const tilted = buffer.t.filter((_, i) => Math.max(twin("x", i), twin("y", i)) > MIN_ACCELERATION);
  return { x, y, verdict: { x: judgeSign(x), y: judgeSign(y) }, seconds: tilted.length * period };
}

/** The axes of a device that sends metres and radians with the twin's signs. */
export const DEFAULT_AXES: AssetAxes = {
  swap: false,
  x_sign: 1,
  y_sign: 1,
  position_unit_m: 1,
  x_offset_m: 0,
  y_offset_m: 0,
  command_unit_rad: 1,
};

/** Returns the axes with which the measurements agree with the twin. */
export function correctedAxes(axes: AssetAxes, { x, y, verdict }: Signs): AssetAxes {
  if (verdict.x === "swapped" && verdict.y === "swapped") {
    const xSign = y.other < 0 ? -1 : 1;
    const ySign = x.other < 0 ? -1 : 1;
    return {
      ...axes,
      swap: !axes.swap,
      x_sign: axes.y_sign * xSign,
      y_sign: axes.x_sign * ySign,
      x_offset_m: axes.y_offset_m * xSign,
      y_offset_m: axes.x_offset_m * ySign,
    };
  }
  const xSign = verdict.x === "reversed" ? -1 : 1;
  const ySign = verdict.y === "reversed" ? -1 : 1;
  return {
    ...axes,
    x_sign: axes.x_sign * xSign,
    y_sign: axes.y_sign * ySign,
    x_offset_m: axes.x_offset_m * xSign,
    y_offset_m: axes.y_offset_m * ySign,
  };
}
