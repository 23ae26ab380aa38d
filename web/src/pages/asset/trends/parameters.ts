/** The parameters of a servo that are tracked over sessions, and their format. */
import type { ServoParameter, Trend, TrendPoint } from "../../../api/types";
import { number } from "../../../words/numbers";

interface Parameter {
  title: string;
  unit: string;
  /** From the unit of the service to the displayed unit. */
  factor: number;
  digits: number;
  about: string;
}

const PARAMETERS: Record<ServoParameter, Parameter> = {
  gain: {
    title: "Gain",
    unit: "",
    factor: 1,
    digits: 2,
    about: "gain relative to the twin: 1 is healthy",
  },
  offset: {
    title: "Offset",
    unit: "m/s²",
    factor: 1,
    digits: 3,
    about: "acceleration not explained by the command",
  },
  delay: { title: "Delay", unit: "ms", factor: 1e3, digits: 0, about: "delay in addition to the twin's" },
};

export const parameterOf = (trend: Trend): Parameter => PARAMETERS[trend.parameter];

/** Formats a value of the parameter with its unit and optionally more digits. */
export const parameterText = ({ factor, digits, unit }: Parameter, value: number, moreDigits = 0) =>
  number(value * factor, digits + moreDigits, unit);

const FIELDS = {
  gain: "gain",
  offset: "offset_m_s2",
  delay: "delay_s",
} as const satisfies Record<ServoParameter, string>;

/** The estimate of a trend's parameter from each session; null if there is none. */
export const estimates = ({ axis, parameter }: Trend, points: TrendPoint[]) =>
  points.map((point) => point[axis]?.[FIELDS[parameter]] ?? null);

/** Whether the drift is significant: the confidence interval of the slope does not contain zero. */
export const isSignificant = (trend: Trend) => trend.slope_low > 0 || trend.slope_high < 0;
