/** One rig, live: the plate and ball, what was measured, what the twin says, what follows. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { api } from "../api/client";
import { follow } from "../api/stream";
import type { Asset, FaultEntry, Monitor, State } from "../api/types";
import { useAsk, useFrames, useNow, useTitle } from "../hooks";
import { PlayoutClock, TraceBuffer } from "../live/buffer";
import { Act, Facts, FaultChip, HealthMark, Loading, Trouble, type Health } from "../parts/bits";
import { LearningCard } from "../parts/learning";
import { DriveCycleCard } from "../parts/drive-cycle";
import type { Mark } from "../parts/line-chart";
import { ChartGroup, RigCharts } from "../parts/rig-charts";
import { RigView } from "../parts/rig-view";
import { TrendsCard, TrendWarnings, useTrends } from "../parts/trends";
import { XyTrace } from "../parts/xy-trace";
import { at, go, Link } from "../router";
import {
  clock,
  codeMeaning,
  codeTitle,
  count,
  degrees,
  isFailing,
  judged,
  millimetres,
  number,
  seconds,
  severity,
} from "../words";

/** States a second; the trace that comes with each has every judged sample. */
const STATE_HZ = 20;

/** Seconds that a tail in the plan view is long. */
const TAIL_S = 4;

/** Charts are drawn in every second frame: they move by less than a pixel in one. */
const CHART_EVERY = 2;

const SPANS = [10, 30, 60] as const;

export function AssetPage({ name }: { name: string }) {
  useTitle(name);
  const asset = useAsk(() => api.asset(name), name, 15_000);
  const faults = useAsk(() => api.faultsOf(name), `${name} faults`, 5000);
  if (!asset.data)
    return (
      <main>
        {asset.error ? (
          <>
            <h1>{name}</h1>
            <Trouble error={asset.error} again={() => void asset.again()} />
          </>
        ) : (
          <Loading what={name} />
        )}
      </main>
    );
  return (
    <Live
      key={name}
      asset={asset.data}
      faults={faults.data ?? []}
      changed={async () => void (await Promise.all([faults.again(), asset.again()]))}
    />
  );
}

function healthOf(faults: FaultEntry[], state: State | undefined, silent: boolean): Health {
  const worst = Math.max(0, ...faults.map(severity));
  if (worst >= 2) return "fault";
  if (worst === 1) return "suspect";
  if (!state?.session_id) return "idle";
  return silent ? "silent" : "ok";
}

function Live({
  asset,
  faults,
  changed,
}: {
  asset: Asset;
  faults: FaultEntry[];
  changed: () => Promise<void>;
}) {
  const buffer = useMemo(() => new TraceBuffer(), [asset.name]);
  const playout = useMemo(() => new PlayoutClock(), [asset.name]);
  const group = useMemo(() => new ChartGroup(), [asset.name]);
  const marks = useRef<Mark[]>([]);
  const [state, setState] = useState<State>();
  const [link, setLink] = useState<"live" | "lost" | undefined>();
  const [span, setSpan] = useState<number>(10);
  const [paused, setPaused] = useState(false);
  const heard = useRef({ at: 0, t: -1, session: "" });
  const shown = useRef(0);
  const now = useNow(500);
  const trends = useTrends(asset.name);

  useEffect(() => {
    let last = 0;
    return follow(asset.name, STATE_HZ, true, {
      link: setLink,
      state: (frame) => {
        if ((frame.session_id ?? "") !== heard.current.session) {
          heard.current.session = frame.session_id ?? "";
          buffer.clear();
          marks.current = [];
          group.setMarks([]);
        }
        if (frame.trace) buffer.append(frame.trace);
        if (frame.t_s != null && frame.t_s !== heard.current.t)
          Object.assign(heard.current, { t: frame.t_s, at: Date.now() });
        if (performance.now() - last < 150) return;
        last = performance.now();
        setState(frame);
      },
      fault: (line) => {
        void changed();
        marks.current = [
          ...marks.current,
          {
            t: line.t_s,
            label: `${codeTitle(line.code)} ${line.status}`,
            colour: !isFailing(line)
              ? "quiet"
              : line.status === "confirmed"
                ? "bad"
                : line.status === "pending"
                  ? "warn"
                  : "quiet",
          },
        ];
        group.setMarks(marks.current);
      },
    });
  }, [asset.name]);

  const frame = useRef(0);
  const frozen = useRef(false);
  frozen.current = paused;
  useFrames((at) => {
    if (!buffer.t.length) return;
    const t = playout.tick(at, buffer.last);
    if (frozen.current) return;
    shown.current = t;
    if (frame.current++ % CHART_EVERY === 0) group.draw(buffer, [t - span, t]);
  });
  const pose = () => {
    if (!buffer.t.length) return { qx: 0, qy: 0, ball: null, ghost: null };
    const t = shown.current;
    const place = (key: "position" | "twinPosition") => {
      const x = buffer.at("x", key, t),
        y = buffer.at("y", key, t);
      return x === null || y === null ? null : { x, y };
    };
    return {
      qx: buffer.at("y", "plate", t) ?? 0,
      qy: buffer.at("x", "plate", t) ?? 0,
      ball: place("position"),
      ghost: place("twinPosition"),
    };
  };

  const silent = now - heard.current.at > 10_000;
  const active = faults.filter((fault) => severity(fault) > 0).sort((a, b) => severity(b) - severity(a));
  const health = healthOf(active, state, silent);
  return (
    <main class="asset">
      <header class="page-head">
        <div>
          <p class="crumbs">
            <Link to="/">Fleet</Link>
          </p>
          <h1>
            {asset.name} <HealthMark health={health} />
          </h1>
        </div>
        <div class="page-tools">
          <Link class="button" to={`/sessions?asset=${encodeURIComponent(asset.name)}`}>
            Sessions
          </Link>
          <Link class="button" to={at("rigs", asset.name, "set-up")}>
            Set-up
          </Link>
          {state?.session_id && <Act act={() => api.endSession(state.session_id!)}>End session</Act>}
        </div>
      </header>
      {link === "lost" && (
        <p class="trouble" role="alert">
          The connection is lost; trying again. What is shown is the last that came.
        </p>
      )}
      {active.length > 0 && (
        <ul class="banner-list" aria-label="Active faults">
          {active.map((fault) => (
            <li>
              <Link to={at("rigs", asset.name, "faults", fault.code)} class={`banner banner-${fault.status}`}>
                <FaultChip {...fault} /> <span>{codeMeaning(fault.code)}</span>{" "}
                <span class="more">Look at it →</span>
              </Link>
            </li>
          ))}
        </ul>
      )}
      <TrendWarnings trends={trends.data} />
      <LearningCard name={asset.name} state={state} changed={changed} />
      {state && !state.session_id && (
        <p class="note">
          No session is open. As soon as the rig sends, it is shown here.{" "}
          <Link to={`${at("rigs", asset.name, "set-up")}?step=connect`}>How to send</Link>
        </p>
      )}
      <div class="live-top">
        <RigView asset={asset} pose={pose} name={`${asset.name}-live`} />
        <div class="live-side">
          <section class="card">
            <h2>From above</h2>
            <XyTrace asset={asset} moment={() => ({ buffer, t: shown.current, tail: TAIL_S })} />
          </section>
          <Monitors monitors={state?.monitors ?? []} />
        </div>
      </div>
      {(!state || state.session_id) && (
        <section class="card">
          <div class="card-head">
            <h2>Rig and twin</h2>
            <div class="chips" role="group" aria-label="Time shown">
              {SPANS.map((s) => (
                <button type="button" class="small" aria-pressed={span === s} onClick={() => setSpan(s)}>
                  {s} s
                </button>
              ))}
              <button type="button" class="small" aria-pressed={paused} onClick={() => setPaused(!paused)}>
                {paused ? "▶ go on" : "❚❚ hold"}
              </button>
            </div>
          </div>
          <RigCharts group={group} kinds={["residual", "acceleration", "command", "position"]} height={136} />
          <p class="quiet small-text">
            Time on the device's clock, s. The residual counts only while the ground is tinted (the gate is
            open); the band is the limit.
          </p>
        </section>
      )}
      <Numbers asset={asset} state={state} />
      <DriveCycleCard asset={asset} />
      <TrendsCard asked={trends} />
    </main>
  );
}

function Monitors({ monitors }: { monitors: Monitor[] }) {
  return (
    <section class="card">
      <h2>Monitors</h2>
      {monitors.length === 0 && <p class="quiet">Waiting for the first state.</p>}
      <ul class="monitors">
        {monitors.map((m) => {
          const share = (m.counter + 128) / 255;
          const word =
            m.counter === 127
              ? "failed"
              : m.counter === -128
                ? "passed"
                : m.enabled
                  ? "testing"
                  : "not tested now";
          const ready = m.complete_this_cycle
            ? "has come to a result in this session"
            : m.complete_since_clear
              ? "no result in this session yet"
              : "no result yet";
          return (
            <li
              class={`monitor monitor-${m.counter === 127 ? "bad" : m.counter > 0 ? "warn" : "ok"}${m.enabled ? "" : " off"}`}
            >
              <span>{codeTitle(m.code)}</span>
              <meter
                class="counter"
                min={-128}
                max={127}
                value={m.counter}
                aria-label={`${codeTitle(m.code)}: fault detection counter`}
                title={`fault detection counter ${m.counter}; ${ready}; judged ${judged(m)} of the session`}
              >
                {Math.round(share * 100)} %
              </meter>
              <span class="quiet">{word}</span>
              <span class="ready" title={ready} aria-label={ready}>
                {m.complete_this_cycle ? "✓" : "…"}
              </span>
            </li>
          );
        })}
      </ul>
      <p class="quiet small-text">
        The bar is the fault detection counter, −128 (passed) to 127 (failed). ✓: the monitor is ready, it has
        come to a result in this session.
      </p>
    </section>
  );
}

function Numbers({ asset, state }: { asset: Asset; state?: State }) {
  const x = state?.evidence.x,
    y = state?.evidence.y;
  const c = asset.calibration;
  return (
    <div class="pair">
      <section class="card">
        <h2>Now</h2>
        <Facts
          of={[
            [
              "Session",
              state?.session_id ? (
                <Link to={at("sessions", state.session_id)}>{state.session}</Link>
              ) : (
                "none open"
              ),
            ],
            ["Device's clock", seconds(state?.t_s)],
            ["Samples", count(state?.samples ?? 0)],
            ["Ball", `${millimetres(x?.position_m)}, ${millimetres(y?.position_m)}`],
            ["Command", `qx ${degrees(y?.command_rad)}, qy ${degrees(x?.command_rad)}`],
            ["Window", seconds(state?.evidence.window_s)],
            ["Scatter of readings", millimetres(state?.evidence.scatter_m, 2)],
          ]}
        />
      </section>
      <section class="card">
        <h2>The twin</h2>
        <Facts
          of={[
            ["Fidelity in use", state?.fidelity ?? "–"],
            ["Why", state?.fidelity_reason ?? "–"],
            ["Profile", asset.diagnostics?.profile ?? "default"],
            ["Learnt", c ? `${clock(c.made_at)}, from ${count(c.samples)} samples` : "not yet"],
            ...(c?.x && c.y
              ? [
                  ["Gain x, y", `${number(c.x.gain, 3)}, ${number(c.y.gain, 3)}`] as [string, string],
                  [
                    "Delay x, y",
                    `${number((c.x.dead_time_s + c.x.lag_s) * 1e3, 0, "ms")}, ${number((c.y.dead_time_s + c.y.lag_s) * 1e3, 0, "ms")}`,
                  ] as [string, string],
                ]
              : []),
          ]}
        />
        <p>
          <button type="button" class="link" onClick={() => go(at("rigs", asset.name, "set-up"))}>
            Describe or calibrate this rig
          </button>
        </p>
      </section>
    </div>
  );
}
