/** The kinds of charts of a rig, for each axis. */
import type { Axis, PlateAngle } from "../../api/types";
import type { NumberColumn, SharedColumn } from "../../live/axis-columns";
import type { GlossaryTerm } from "../../words/glossary";
import type { Line, Threshold } from "./chart-options";
import { MONITOR_KINDS } from "./monitor-kinds";

export interface ChartKind {
  title: (axis: Axis) => string;
  /** The term of the glossary that explains the title. */
  term?: GlossaryTerm;
  unit: string;
  digits: number;
  /** Smallest extent of the scale on either side of zero. */
  minExtent: number;
  /** The columns of the buffer that are drawn, each multiplied by its factor. */
  lines: (Line & { column: NumberColumn | SharedColumn; factor?: number })[];
  /** Whether no value is negative, so that the scale begins at zero. */
  isPositive?: boolean;
  /** Values that are drawn as horizontal lines. */
  thresholds?: Threshold[];
  /** Indices of the upper and lower line between which the band is filled. */
  band?: [number, number];
  /** Whether the background is shaded where the residual is judged. */
  showsGates: boolean;
  /** Whether marks have their labels here; on the other charts they would cover the curves once more. */
  hasMarkLabels?: boolean;
  /** Description for screen readers. */
  about: string;
}

const DEGREES = 180 / Math.PI;
const DASHED = [6, 3];

/** The commanded plate angle that moves the ball along an axis. */
const COMMAND: Record<Axis, PlateAngle> = { x: "qy", y: "qx" };

const acceleration: ChartKind = {
  title: (axis) => `Acceleration along ${axis}`,
  unit: "m/s²",
  digits: 1,
  minExtent: 0.5,
  showsGates: false,
  lines: [
    { column: "measured", label: "measured", colour: "measured" },
    { column: "twin", label: "twin", colour: "twin", dash: DASHED },
  ],
  about: "the measured acceleration, and the twin's prediction for a healthy rig",
};

const residual: ChartKind = {
  title: (axis) => `Residual along ${axis}`,
  term: "residual",
  unit: "m/s²",
  digits: 1,
  minExtent: 0.3,
  showsGates: true,
  hasMarkLabels: true,
  band: [1, 2],
  lines: [
    { column: "residual", label: "measured − twin", colour: "residual", width: 2 },
    { column: "limit", label: "limit", colour: "limit", width: 1 },
    { column: "limitBelow", label: "", colour: "limit", width: 1 },
  ],
  about: "outside the band, while the background is shaded, it is evidence of a servo fault",
};

const position: ChartKind = {
  title: (axis) => `Position ${axis}`,
  unit: "mm",
  digits: 0,
  minExtent: 20,
  showsGates: false,
  lines: [
    { column: "position", label: "measured", colour: "measured", factor: 1000 },
    { column: "twinPosition", label: "twin", colour: "twin", dash: DASHED, factor: 1000 },
  ],
  about: "the measured position of the ball, and the twin's",
};

const command: ChartKind = {
  title: (axis) => `Command ${COMMAND[axis]}`,
  unit: "°",
  digits: 0,
  minExtent: 2,
  showsGates: false,
  lines: [
    { column: "command", label: "command", colour: "command", factor: DEGREES },
    { column: "plate", label: "twin's plate", colour: "twin", dash: DASHED, factor: DEGREES },
  ],
  about: "the commanded plate angle, and the angle of the twin's plate",
};

export const CHART_KINDS = { acceleration, residual, position, command, ...MONITOR_KINDS };

export type ChartKindName = keyof typeof CHART_KINDS;

/** All kinds, in the order on the page of a rig. */
export const ALL_CHARTS: ChartKindName[] = ["residual", "counter", "acceleration", "command", "position"];

/** The kinds that the recording of a fault has. */
export const RECORDED_CHARTS = ALL_CHARTS.filter((name) => name !== "counter");

/** The kinds on the page of a session besides those of the chosen monitor. */
export const SESSION_CHARTS = RECORDED_CHARTS.filter((name) => name !== "residual");

const TWIN_POSITIONS: (NumberColumn | SharedColumn)[] = ["twinPosition", "plate"];

/** Returns a kind without the lines of the twin's position and plate angle. */
export const withoutTwinPositions = (kind: ChartKind): ChartKind => ({
  ...kind,
  lines: kind.lines.filter(({ column }) => !TWIN_POSITIONS.includes(column)),
});
