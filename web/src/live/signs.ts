/** Does the rig do what the twin says? Signs and axes, from the two accelerations. */
import type { AssetAxes, Axis } from "../api/types";
import type { TraceBuffer } from "./buffer";
import { correlation, judge, type Verdict } from "./csv";

export interface Signs {
  x: { own: number; other: number };
  y: { own: number; other: number };
  verdict: Record<Axis, Verdict>;
  /** Seconds with something to compare. */
  seconds: number;
}

/** Accelerations of the twin smaller than this say nothing, m/s²: about a degree of tilt. */
const LEAST = 0.12;

export function compare(buffer: TraceBuffer): Signs {
  const pairs = (a: Axis, b: Axis): [number[], number[]] => {
    const measured: number[] = [],
      twin: number[] = [];
    buffer.t.forEach((_, i) => {
      const m = buffer[a].measured[i],
        t = buffer[b].twin[i];
      if (m == null || t == null) return;
      measured.push(m);
      twin.push(t);
    });
    return [measured, twin];
  };
  const axis = (a: Axis, b: Axis) => ({
    own: correlation(...pairs(a, a)),
    other: correlation(...pairs(a, b)),
  });
  const x = axis("x", "y"),
    y = axis("y", "x");
  const period = buffer.t.length > 1 ? (buffer.last - buffer.first) / (buffer.t.length - 1) : 0;
  const asked = buffer.t.filter(
    (_, i) => Math.max(Math.abs(buffer.x.twin[i] ?? 0), Math.abs(buffer.y.twin[i] ?? 0)) > LEAST,
  ).length;
  return { x, y, verdict: { x: judge(x), y: judge(y) }, seconds: asked * period };
}

export const PLAIN: AssetAxes = {
  swap: false,
  x_sign: 1,
  y_sign: 1,
  position_unit_m: 1,
  x_offset_m: 0,
  y_offset_m: 0,
  command_unit_rad: 1,
};

/** The axes with which the rig would do what the twin says. */
export function mended(axes: AssetAxes, signs: Signs): AssetAxes {
  const swapped = signs.verdict.x === "swapped" && signs.verdict.y === "swapped";
  if (swapped) {
    return {
      ...axes,
      swap: !axes.swap,
      x_sign: axes.y_sign * (signs.y.other < 0 ? -1 : 1),
      y_sign: axes.x_sign * (signs.x.other < 0 ? -1 : 1),
      x_offset_m: axes.y_offset_m * (signs.y.other < 0 ? -1 : 1),
      y_offset_m: axes.x_offset_m * (signs.x.other < 0 ? -1 : 1),
    };
  }
  return {
    ...axes,
    x_sign: signs.verdict.x === "reversed" ? -axes.x_sign : axes.x_sign,
    y_sign: signs.verdict.y === "reversed" ? -axes.y_sign : axes.y_sign,
    x_offset_m: signs.verdict.x === "reversed" ? -axes.x_offset_m : axes.x_offset_m,
    y_offset_m: signs.verdict.y === "reversed" ? -axes.y_offset_m : axes.y_offset_m,
  };
}
