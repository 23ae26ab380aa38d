/** Drift before fault: what each session estimated of both servos, the line through it, and its limits. */
import { api } from "../api/client";
import type { Axis, Trend, TrendPoint, Trends } from "../api/types";
import { useAsk } from "../hooks";
import { codeTitle, number, sentence } from "../words";
import { Loading, Trouble } from "./bits";

/** A session ends rarely. */
const EVERY_MS = 30_000;

const PARAMETER: Record<
  string,
  { title: string; unit: string; factor: number; digits: number; about: string }
> = {
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

const VALUE: Record<string, "gain" | "offset_m_s2" | "delay_s"> = {
  gain: "gain",
  offset: "offset_m_s2",
  delay: "delay_s",
};

export function useTrends(name: string) {
  return useAsk(() => api.trends(name), `${name} trends`, EVERY_MS);
}

export function TrendWarnings({ trends }: { trends?: Trends }) {
  const warnings = trends?.trends.flatMap((trend) => trend.warning ?? []) ?? [];
  if (!warnings.length) return null;
  return (
    <ul class="banner-list" aria-label="Faults on their way">
      {warnings.map((warning) => (
        <li>
          <a href="#drift" class="banner">
            <span class="chip chip-drift">
              <b>
                {codeTitle(warning.code)}, {warning.parameter}
              </b>{" "}
              <span>drifts</span>
            </span>{" "}
            <span>{sentence(warning.summary)}</span>
          </a>
        </li>
      ))}
    </ul>
  );
}

export function TrendsCard({ asked }: { asked: ReturnType<typeof useTrends> }) {
  const trends = asked.data;
  const points = trends?.points.filter((point) => point.calibration_id === trends.calibration_id) ?? [];
  return (
    <section class="card" id="drift">
      <h2>Drift over sessions</h2>
      <Trouble error={asked.error} again={() => void asked.again()} />
      {!trends && !asked.error && <Loading what="the trends" />}
      {trends && !trends.calibration_id && (
        <p class="quiet">Nothing is followed until the rig has been learnt.</p>
      )}
      {trends?.calibration_id && !trends.trends.length && (
        <p class="quiet">
          {points.length} of 7 sessions that it takes have been estimated since the rig was learnt; each needs
          twenty seconds in which the ball moves. A session counts once it has ended.
        </p>
      )}
      {trends && trends.trends.length > 0 && (
        <>
          <p class="quiet small-text">
            One dot for each session since the rig was learnt, oldest on the left. A line that surely leads
            beyond a limit (dashed) within 20 sessions is warned of. Compare like with like: another motion
            may move the dots too.
          </p>
          <div class="trends">
            {trends.trends.map((trend) => (
              <TrendChart trend={trend} points={points} />
            ))}
          </div>
        </>
      )}
    </section>
  );
}

const WIDTH = 300,
  HEIGHT = 110,
  SIDE = 8,
  HEAD = 6;

function TrendChart({ trend, points }: { trend: Trend; points: TrendPoint[] }) {
  const { title, unit, factor, digits, about } = PARAMETER[trend.parameter] ?? {
    title: trend.parameter,
    unit: "",
    factor: 1,
    digits: 3,
    about: "",
  };
  const values = points.map((point) => point[trend.axis as Axis]?.[VALUE[trend.parameter]!] ?? null);
  const seen = values.filter((value): value is number => value !== null);
  const [low, high] = [Math.min(trend.limit_low, ...seen), Math.max(trend.limit_high, ...seen)];
  const room = (high - low) * 0.06;
  const y = (value: number) =>
    HEAD + (HEIGHT - 2 * HEAD) * (1 - (value - low + room) / (high - low + 2 * room));
  const last = Math.max(values.length - 1, 1);
  const x = (i: number) => SIDE + (WIDTH - 2 * SIDE) * (i / last);
  const line = (i: number) => trend.level + trend.slope * (i - (values.length - 1));
  const write = (value: number, more = 0) => number(value * factor, digits + more, unit);
  const sure = trend.slope_low > 0 || trend.slope_high < 0;
  const said = `${title} of the ${trend.axis} servo over ${trend.sessions} sessions: now ${write(trend.level)}, ${write(trend.slope, 1)} a session, limits ${write(trend.limit_low)} and ${write(trend.limit_high)}${trend.warning ? "; it is warned of" : ""}`;
  return (
    <figure class={`trend${trend.warning ? " warned" : ""}`}>
      <figcaption>
        <b>
          {title}, {trend.axis} servo
        </b>{" "}
        <span class="n">{write(trend.level)}</span>
      </figcaption>
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={said}>
        <title>{about}</title>
        {[trend.limit_low, trend.limit_high].map((limit) => (
          <line class="limit" x1={0} x2={WIDTH} y1={y(limit)} y2={y(limit)} />
        ))}
        <line class="nominal" x1={0} x2={WIDTH} y1={y(trend.nominal)} y2={y(trend.nominal)} />
        {sure && (
          <line
            class="slope"
            x1={x(0)}
            x2={x(values.length - 1)}
            y1={y(line(0))}
            y2={y(line(values.length - 1))}
          />
        )}
        {values.map(
          (value, i) =>
            value !== null && (
              <circle cx={x(i)} cy={y(value)} r={3}>
                <title>
                  {points[i]!.session}: {write(value, 1)}
                </title>
              </circle>
            ),
        )}
      </svg>
      <p class="quiet small-text">
        limits {number(trend.limit_low * factor, digits)} and {write(trend.limit_high)};{" "}
        {sure ? <>{write(trend.slope, 1)} a session</> : "no sure drift"}
        {trend.warning?.sessions_left != null && (
          <b class="late">; at the limit in {Math.round(trend.warning.sessions_left)} sessions</b>
        )}
      </p>
    </figure>
  );
}

/** In a list: the parameters that drift. */
export function DriftChips({
  warnings,
}: {
  warnings: { code: string; parameter: string; sessions_left?: number | null; summary: string }[];
}) {
  return (
    <>
      {warnings.map((w) => (
        <span class="chip chip-drift" title={sentence(w.summary)}>
          <b>
            {codeTitle(w.code)}, {w.parameter}
          </b>{" "}
          <span>
            {w.sessions_left == null ? "drifted" : `fault in ${Math.round(w.sessions_left)} sessions`}
          </span>
        </span>
      ))}
    </>
  );
}
