import type { Trend, TrendPoint } from "../../../api/types";
import { number } from "../../../words/numbers";
import { isSignificant, parameterOf, parameterText } from "./parameters";
import { TrendPlot } from "./trend-plot";

/** One parameter of one servo over the sessions, with its trend as text. */
export function TrendChart({ trend, points }: { trend: Trend; points: TrendPoint[] }) {
  const parameter = parameterOf(trend);
  const { title, factor, digits } = parameter;
  const text = (value: number, moreDigits = 0) => parameterText(parameter, value, moreDigits);
  const slope = `${text(trend.slope, 1)} per session`;
  const sessionsLeft = trend.warning?.sessions_left;
  const label =
    `${title} of the ${trend.axis} servo over ${trend.sessions} sessions: now ${text(trend.level)}, ${slope}, ` +
    `limits ${text(trend.limit_low)} and ${text(trend.limit_high)}${trend.warning ? "; warning" : ""}`;
  return (
    <figure class={`trend${trend.warning ? " warned" : ""}`}>
      <figcaption>
        <b>
          {title}, {trend.axis} servo
        </b>{" "}
        <span class="n">{text(trend.level)}</span>
      </figcaption>
      <TrendPlot trend={trend} points={points} label={label} />
      <p class="quiet small-text">
        limits {number(trend.limit_low * factor, digits)} and {text(trend.limit_high)};{" "}
        {isSignificant(trend) ? slope : "no significant drift"}
        {sessionsLeft != null && <b class="late">; at the limit in {Math.round(sessionsLeft)} sessions</b>}
      </p>
    </figure>
  );
}
