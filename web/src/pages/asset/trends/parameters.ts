/** The parameters of a servo that are followed over the sessions, and how they are written. */
import type { Trend, TrendPoint } from "../../../api/types";
import { number } from "../../../words/numbers";

interface Parameter {
  title: string;
  unit: string;
  /** From the service's unit to the one that is shown. */
  factor: number;
  digits: number;
  about: string;
}

const PARAMETERS: Record<string, Parameter> = {
  gain: {
    title: "Gain",
    unit: "",
    factor: 1,
    digits: 2,
    about: "share of the command that the ball answers",
  },
  offset: {
    title: "Offset",
    unit: "m/s²",
    factor: 1,
    digits: 3,
    about: "acceleration that no command explains",
  },
  delay: { title: "Delay", unit: "ms", factor: 1e3, digits: 0, about: "beyond the twin's" },
};

export const parameterOf = (trend: Trend): Parameter =>
  PARAMETERS[trend.parameter] ?? { title: trend.parameter, unit: "", factor: 1, digits: 3, about: "" };

/** A value of the parameter in its unit, with more digits than usual if wanted. */
export const parameterText = ({ factor, digits, unit }: Parameter, value: number, moreDigits = 0) =>
  number(value * factor, digits + moreDigits, unit);

const FIELDS: Record<string, "gain" | "offset_m_s2" | "delay_s"> = {
  gain: "gain",
  offset: "offset_m_s2",
  delay: "delay_s",
};

/** What each session estimated of a trend's parameter; null where it could not. */
export const estimates = ({ axis, parameter }: Trend, points: TrendPoint[]) =>
  points.map((point) => point[axis as "x" | "y"]?.[FIELDS[parameter]!] ?? null);

/** Whether the parameter drifts for sure: its slope is not zero within what is known of it. */
export const isSureDrift = (trend: Trend) => trend.slope_low > 0 || trend.slope_high < 0;
