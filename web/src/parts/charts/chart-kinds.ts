/** What can be charted of a rig along each axis, and how. */
import type { Axis } from "../../api/types";
import type { NumberColumn } from "../../live/axis-columns";
import type { Line } from "./chart-options";

export interface ChartKind {
  title: (axis: Axis) => string;
  unit: string;
  digits: number;
  /** The scale never shows less than this much either side of zero. */
  least: number;
  /** The columns of the buffer that are drawn, each times its factor. */
  lines: (Line & { column: NumberColumn; factor?: number })[];
  band?: [number, number];
  /** Whether the ground is tinted where the residual is judged. */
  showsGates: boolean;
  /** What it shows, for whoever does not see it. */
  about: string;
}

const DEGREES = 180 / Math.PI;
const DASHED = [6, 3];

/** The command that moves the ball along an axis. */
const COMMAND: Record<Axis, string> = { x: "qy", y: "qx" };

const acceleration: ChartKind = {
  title: (axis) => `Acceleration along ${axis}`,
  unit: "m/s²",
  digits: 1,
  least: 0.5,
  showsGates: false,
  lines: [
    { column: "measured", label: "measured", colour: "measured" },
    { column: "twin", label: "twin", colour: "twin", dash: DASHED },
  ],
  about: "what the ball did, and what the twin says a healthy rig would have done",
};

const residual: ChartKind = {
  title: (axis) => `Residual along ${axis}`,
  unit: "m/s²",
  digits: 1,
  least: 0.3,
  showsGates: true,
  band: [1, 2],
  lines: [
    { column: "residual", label: "measured − twin", colour: "residual", width: 2 },
    { column: "limit", label: "limit", colour: "limit", width: 1 },
    { column: "limitBelow", label: "", colour: "limit", width: 1 },
  ],
  about: "outside the band, while the ground is tinted, it counts against the servo",
};

const position: ChartKind = {
  title: (axis) => `Position ${axis}`,
  unit: "mm",
  digits: 0,
  least: 20,
  showsGates: false,
  lines: [
    { column: "position", label: "measured", colour: "measured", factor: 1000 },
    { column: "twinPosition", label: "twin", colour: "twin", dash: DASHED, factor: 1000 },
  ],
  about: "where the ball is, and where the twin would be",
};

const command: ChartKind = {
  title: (axis) => `Command ${COMMAND[axis]}`,
  unit: "°",
  digits: 0,
  least: 2,
  showsGates: false,
  lines: [
    { column: "command", label: "command", colour: "command", factor: DEGREES },
    { column: "plate", label: "twin's plate", colour: "twin", dash: DASHED, factor: DEGREES },
  ],
  about: "the plate angle that is asked for, and the one that the twin's servo has reached",
};

export const CHART_KINDS = { acceleration, residual, position, command };

export type ChartKindName = keyof typeof CHART_KINDS;

/** All kinds, in the order in which a rig's page shows them. */
export const ALL_CHARTS: ChartKindName[] = ["residual", "acceleration", "command", "position"];

const TWIN_POSITIONS: NumberColumn[] = ["twinPosition", "plate"];

/** A kind without the lines of where the twin and its plate were. */
export const withoutTwinPositions = (kind: ChartKind): ChartKind => ({
  ...kind,
  lines: kind.lines.filter(({ column }) => !TWIN_POSITIONS.includes(column)),
});
