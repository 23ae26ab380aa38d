/** A rig in five minutes: describe it, connect it, check its signs, learn it. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { api, isSettled, until } from "../api/client";
import { follow } from "../api/stream";
import type {
  Asset,
  AssetAxes,
  AxisCalibration,
  CalibrationJob,
  MonitorCertificate,
  Prospects,
  ServoProspects,
  Session,
  State,
} from "../api/types";
import { useAsk, useNow, useTitle } from "../hooks";
import { PlayoutClock, TraceBuffer } from "../live/buffer";
import { compare, mended, PLAIN, type Signs } from "../live/signs";
import { snippets } from "../live/snippets";
import { Act, Code, Facts, Loading, Trouble } from "../parts/bits";
import { DeviceToken, useCaller } from "../parts/door";
import { XyTrace } from "../parts/xy-trace";
import { at, go, Link, usePlace } from "../router";
import { clock, codeTitle, count, degrees, duration, millimetres, number, seconds } from "../words";

const STEPS = [
  { key: "describe", word: "Describe" },
  { key: "connect", word: "Connect" },
  { key: "check", word: "Check" },
  { key: "learn", word: "Learn" },
] as const;
type Step = (typeof STEPS)[number]["key"];

export function SetUpPage({ name }: { name?: string }) {
  useTitle(name ? `Set up ${name}` : "Set up a rig");
  const { query } = usePlace();
  const asset = useAsk(() => (name ? api.asset(name) : Promise.resolve(undefined)), name ?? "new");
  const step = (name ? (query.get("step") ?? "describe") : "describe") as Step;
  const to = (next: Step, of = name!) => go(`${at("rigs", of, "set-up")}?step=${next}`);
  if (name && !asset.data)
    return (
      <main>
        {asset.error ? (
          <>
            <h1>Set up {name}</h1>
            <Trouble error={asset.error} again={() => void asset.again()} />
          </>
        ) : (
          <Loading what={name} />
        )}
      </main>
    );
  return (
    <main class="set-up">
      <header class="page-head">
        <div>
          {name && (
            <p class="crumbs">
              <Link to="/">Fleet</Link> / <Link to={at("rigs", name)}>{name}</Link>
            </p>
          )}
          <h1>{name ? `Set up ${name}` : "Set up a rig"}</h1>
        </div>
      </header>
      <ol class="steps" aria-label="Steps">
        {STEPS.map(({ key, word }, i) => (
          <li aria-current={key === step ? "step" : undefined}>
            {name ? (
              <button type="button" class="link" onClick={() => to(key)}>
                {i + 1}. {word}
              </button>
            ) : (
              <span>
                {i + 1}. {word}
              </span>
            )}
          </li>
        ))}
      </ol>
      {step === "describe" && <Describe asset={asset.data} done={(created) => to("connect", created)} />}
      {step === "connect" && name && <Connect name={name} next={() => to("check")} />}
      {step === "check" && asset.data && (
        <Check asset={asset.data} changed={asset.again} next={() => to("learn")} />
      )}
      {step === "learn" && asset.data && <Learn asset={asset.data} changed={asset.again} />}
    </main>
  );
}

interface Form {
  name: string;
  rate: number;
  radius: number;
  mass: number;
  inertia: number;
  round: boolean;
  length: number;
  width: number;
  diameter: number;
  rim: boolean;
  limit: number;
  position: number;
  command: number;
}

const round = (n: number) => Number(n.toPrecision(6));

function formOf(asset?: Asset): Form {
  const { plate, ball, servo, axes } = asset ?? {};
  return {
    name: asset?.name ?? "",
    rate: asset?.sample_rate_hz ?? 100,
    radius: round((ball?.radius_m ?? 0.0127) * 1e3),
    mass: round((ball?.mass_kg ?? 0.051) * 1e3),
    inertia: ball?.inertia_factor ?? 0.4,
    round: plate?.diameter_m != null,
    length: round((plate?.length_m ?? 0.38) * 1e3),
    width: round((plate?.width_m ?? 0.24) * 1e3),
    diameter: round((plate?.diameter_m ?? 0.3) * 1e3),
    rim: plate?.rim ?? true,
    limit: round(((servo?.angle_limit_rad ?? 0.2) * 180) / Math.PI),
    position: axes?.position_unit_m ?? 1,
    command: axes?.command_unit_rad ?? 1,
  };
}

function assetOf(form: Form, before?: Asset): Asset {
  const size = form.round
    ? { diameter_m: form.diameter / 1e3 }
    : { length_m: form.length / 1e3, width_m: form.width / 1e3 };
  const plate = { thickness_m: before?.plate?.thickness_m ?? 0.003, rim: form.rim, ...size };
  const servo = { ...before?.servo, angle_limit_rad: (form.limit * Math.PI) / 180 };
  const axes = { ...PLAIN, ...before?.axes, position_unit_m: form.position, command_unit_rad: form.command };
  return {
    ...before,
    name: form.name,
    sample_rate_hz: form.rate,
    plate,
    servo,
    axes,
    ball: { radius_m: form.radius / 1e3, mass_kg: form.mass / 1e3, inertia_factor: form.inertia },
  } as Asset;
}

const DEGREE = 0.017453292519943295;

function Describe({ asset, done }: { asset?: Asset; done: (name: string) => void }) {
  const [form, setForm] = useState(() => formOf(asset));
  const set = <K extends keyof Form>(key: K, value: Form[K]) =>
    setForm((before) => ({ ...before, [key]: value }));
  const figure = (
    key: "rate" | "radius" | "mass" | "length" | "width" | "diameter" | "limit",
    word: string,
    unit: string,
  ) => (
    <label>
      {word}, {unit}{" "}
      <input
        type="number"
        step="any"
        min="0"
        required
        value={form[key]}
        onInput={(e) => set(key, e.currentTarget.valueAsNumber)}
      />
    </label>
  );
  const keep = async () => {
    const wanted = assetOf(form, asset);
    if (asset) await api.putAsset(wanted);
    else await api.createAsset(wanted);
    done(form.name);
  };
  const named = /^[A-Za-z0-9._-]{1,128}$/.test(form.name);
  return (
    <form class="card" onSubmit={(e) => e.preventDefault()}>
      <p>
        What you know on day one. What is left as it is, is the book chapter's rig; the rest is learnt later.
      </p>
      <fieldset>
        <legend>The rig</legend>
        <div class="form-row">
          <label>
            Name{" "}
            <input
              value={form.name}
              disabled={Boolean(asset)}
              required
              pattern="[A-Za-z0-9._\-]+"
              maxLength={128}
              placeholder="bench-1"
              onInput={(e) => set("name", e.currentTarget.value)}
              aria-describedby="name-rule"
            />
          </label>
          {figure("rate", "Samples a second", "Hz")}
        </div>
        <p id="name-rule" class="quiet small-text">
          Letters, digits, “-”, “_” and “.”.
        </p>
      </fieldset>
      <fieldset>
        <legend>Ball</legend>
        <div class="form-row">
          {figure("radius", "Radius", "mm")}
          {figure("mass", "Mass", "g")}
          <label>
            Kind{" "}
            <select value={form.inertia} onChange={(e) => set("inertia", Number(e.currentTarget.value))}>
              <option value={0.4}>solid</option>
              <option value={0.667}>hollow</option>
              {![0.4, 0.667].includes(form.inertia) && (
                <option value={form.inertia}>inertia factor {form.inertia}</option>
              )}
            </select>
          </label>
        </div>
      </fieldset>
      <fieldset>
        <legend>Plate and servos</legend>
        <div class="form-row">
          <label>
            Shape{" "}
            <select
              value={form.round ? "round" : "rectangle"}
              onChange={(e) => set("round", e.currentTarget.value === "round")}
            >
              <option value="rectangle">rectangle</option>
              <option value="round">round</option>
            </select>
          </label>
          {form.round ? (
            figure("diameter", "Diameter", "mm")
          ) : (
            <>
              {figure("length", "Length along x", "mm")}
              {figure("width", "Width along y", "mm")}
            </>
          )}
          {figure("limit", "Largest plate angle", "°")}
          <label class="check">
            <input type="checkbox" checked={form.rim} onChange={(e) => set("rim", e.currentTarget.checked)} />{" "}
            a rim stops the ball
          </label>
        </div>
      </fieldset>
      <fieldset>
        <legend>Units that the device sends</legend>
        <div class="form-row">
          <label>
            Ball's position{" "}
            <select value={form.position} onChange={(e) => set("position", Number(e.currentTarget.value))}>
              {[
                [1, "m"],
                [0.001, "mm"],
                [0.01, "cm"],
              ].map(([v, w]) => (
                <option value={v}>{w}</option>
              ))}
            </select>
          </label>
          <label>
            Commands{" "}
            <select value={form.command} onChange={(e) => set("command", Number(e.currentTarget.value))}>
              <option value={1}>rad</option>
              <option value={DEGREE}>degrees</option>
            </select>
          </label>
        </div>
        <p class="quiet small-text">
          Commands are the angles of the plate, not those of the servo's horn. +qy moves the ball toward +x,
          +qx toward −y; the check comes two steps on.
        </p>
      </fieldset>
      <div class="form-end">
        <Act class="primary" act={keep} disabled={!named}>
          {asset ? "Keep and go on" : "Register and go on"}
        </Act>
      </div>
    </form>
  );
}

/** The rig's stream for the steps that wait for it. */
function useRig(name: string) {
  const buffer = useMemo(() => new TraceBuffer(), [name]);
  const [state, setState] = useState<State>();
  const heard = useRef({ t: -1, at: 0, session: "" });
  useEffect(
    () =>
      follow(name, 10, true, {
        state: (frame) => {
          if ((frame.session_id ?? "") !== heard.current.session) {
            heard.current.session = frame.session_id ?? "";
            buffer.clear();
          }
          if (frame.trace) buffer.append(frame.trace);
          if (frame.t_s != null && frame.t_s !== heard.current.t)
            Object.assign(heard.current, { t: frame.t_s, at: Date.now() });
          setState(frame);
        },
      }),
    [name],
  );
  const now = useNow(1000);
  const alive = now - heard.current.at < 5000;
  return { state, buffer, alive };
}

function Connect({ name, next }: { name: string; next: () => void }) {
  const [token, setToken] = useState("offbd_TOKEN");
  const asks = useCaller()?.authentication === "required";
  const all = snippets(name, location.origin, asks ? token : undefined);
  const [word, setWord] = useState("Python");
  const { state, alive } = useRig(name);
  const came = (state?.samples ?? 0) > 0;
  return (
    <section class="card">
      <p>
        Send samples as they come, ten times a second or so. The service answers once they are stored; what is
        sent twice counts once.
      </p>
      <div class="chips" role="group" aria-label="Language">
        {all.map((each) => (
          <button type="button" aria-pressed={each.word === word} onClick={() => setWord(each.word)}>
            {each.word}
          </button>
        ))}
      </div>
      <Code label={`${word} snippet`}>{all.find((each) => each.word === word)!.text}</Code>
      <p class="quiet small-text">
        <DeviceToken asset={name} made={setToken} />
        {/localhost|127\.0\.0\.1/.test(location.hostname) &&
          " A device needs this computer's name or address instead of 127.0.0.1, and the service must listen there (--listen 0.0.0.0:8087)."}
      </p>
      <div class={`wait ${came ? "wait-good" : ""}`} role="status">
        {came ? (
          <>
            <b>{alive ? "Samples are coming." : "Samples have come."}</b> {count(state!.samples)} in session{" "}
            <b>{state!.session}</b>
            {state!.t_s == null ? (
              "; they are judged as soon as later ones follow."
            ) : (
              <>
                , the last at {seconds(state!.t_s)} on the device's clock: ball at{" "}
                {millimetres(state!.evidence.x.position_m)}, {millimetres(state!.evidence.y.position_m)}.
              </>
            )}
          </>
        ) : (
          <>
            <span class="spinner" aria-hidden="true" /> Waiting for the first sample…
          </>
        )}
      </div>
      <div class="form-end">
        <button type="button" class="primary" disabled={!came} onClick={next}>
          Check it
        </button>
      </div>
    </section>
  );
}

/** Seconds of tilting after which the check has something to say. */
const ENOUGH_S = 3;

function Check({ asset, changed, next }: { asset: Asset; changed: () => Promise<void>; next: () => void }) {
  const { state, buffer, alive } = useRig(asset.name);
  const playout = useMemo(() => new PlayoutClock(), []);
  const [signs, setSigns] = useState<Signs>();
  useEffect(() => {
    const timer = setInterval(() => setSigns(compare(buffer)), 1000);
    return () => clearInterval(timer);
  }, [buffer]);
  const axes: AssetAxes = { ...PLAIN, ...asset.axes };
  const keep = async (wanted: AssetAxes) => {
    await api.putAsset({ ...asset, axes: wanted });
    if (state?.session_id) await api.endSession(state.session_id);
    buffer.clear();
    setSigns(undefined);
    await changed();
  };
  const x = state?.evidence.x,
    y = state?.evidence.y;
  const wrong =
    signs &&
    (["reversed", "swapped"].includes(signs.verdict.x) || ["reversed", "swapped"].includes(signs.verdict.y));
  const far = Math.max(Math.abs(x?.position_m ?? 0), Math.abs(y?.position_m ?? 0)) > 2;
  const steep = Math.max(Math.abs(x?.command_rad ?? 0), Math.abs(y?.command_rad ?? 0)) > 1.6;
  const agrees = signs?.verdict.x === "agrees" && signs.verdict.y === "agrees";
  const ready = (signs?.seconds ?? 0) >= ENOUGH_S;
  return (
    <div class="pair">
      <section class="card">
        <h2>Live</h2>
        {!alive && <p class="note">Nothing comes in right now.</p>}
        <XyTrace
          asset={asset}
          moment={() =>
            buffer.t.length ? { buffer, t: playout.tick(performance.now(), buffer.last), tail: 3 } : null
          }
        />
        <Facts
          of={[
            ["Command qy, ball x", `${degrees(x?.command_rad)}, ${millimetres(x?.position_m)}`],
            ["Command qx, ball y", `${degrees(y?.command_rad)}, ${millimetres(y?.position_m)}`],
            [
              "Rate",
              number(
                buffer.t.length > 20 ? (buffer.t.length - 1) / (buffer.last - buffer.first) : null,
                0,
                "Hz",
              ),
            ],
          ]}
        />
      </section>
      <section class="card">
        <h2>Signs and units</h2>
        <p>
          Let the rig move the ball about, by its controller or by hand. Tilt by +qy: the ball must go to the
          right (+x). Tilt by +qx: it must go down (−y).
        </p>
        {far && (
          <p class="trouble" role="alert">
            The ball is metres away.{" "}
            <Act act={() => keep({ ...axes, position_unit_m: 0.001 })}>Positions are in mm</Act>
          </p>
        )}
        {steep && (
          <p class="trouble" role="alert">
            The plate tilts beyond 90°.{" "}
            <Act act={() => keep({ ...axes, command_unit_rad: DEGREE })}>Commands are in degrees</Act>
          </p>
        )}
        {!ready && (
          <p role="status">
            {signs && signs.seconds > 0
              ? `Tilting seen for ${seconds(signs.seconds, 1)} of ${ENOUGH_S} s…`
              : "Waiting for the ball to move…"}
          </p>
        )}
        {ready && (
          <ul class="sanity" role="status">
            {(["x", "y"] as const).map((axis) => {
              const { own, other } = signs![axis];
              const text = {
                agrees: "moves as the command asks",
                reversed: "moves the wrong way round",
                swapped: "follows the other command",
                unclear: "cannot be told yet",
              }[signs!.verdict[axis]];
              const good = signs!.verdict[axis] === "agrees";
              return (
                <li class={good ? "good" : signs!.verdict[axis] === "unclear" ? "" : "warn"}>
                  {axis}: {text}{" "}
                  <span class="quiet">
                    (correlation with its own command {number(own, 2)}, with the other {number(other, 2)})
                  </span>
                </li>
              );
            })}
          </ul>
        )}
        {ready && wrong && (
          <p>
            <Act class="primary" act={() => keep(mended(axes, signs))}>
              Put it right
            </Act>{" "}
            <span class="quiet">
              Changes the axes in the set-up and begins a new session; the device stays as it is.
            </span>
          </p>
        )}
        <p class="quiet small-text">
          In the set-up: {axes.swap ? "x and y swapped, " : ""}x sign {axes.x_sign > 0 ? "+" : "−"}, y sign{" "}
          {axes.y_sign > 0 ? "+" : "−"}, position unit {axes.position_unit_m} m, command unit{" "}
          {number(axes.command_unit_rad, 4)} rad.
        </p>
        <div class="form-end">
          <button type="button" class={agrees ? "primary" : ""} onClick={next}>
            {agrees ? "Good: learn it" : "Go on without"}
          </button>
        </div>
      </section>
    </div>
  );
}

/** Rolling for so long is what calibration asks for, s. */
const MINUTE_S = 60;

function Learn({ asset, changed }: { asset: Asset; changed: () => Promise<void> }) {
  const sessions = useAsk(
    () => api.sessions({ asset: asset.name, limit: 20 }).then((page) => page.items),
    `${asset.name} sessions`,
    2000,
  );
  const [chosen, setChosen] = useState<Set<string>>();
  const [job, setJob] = useState<CalibrationJob>();
  const length = (s: Session) => (s.first_t_s != null && s.last_t_s != null ? s.last_t_s - s.first_t_s : 0);
  // Only the newest is proposed: an earlier one may have come before the axes were put right.
  const newest = sessions.data?.[0];
  const usable = newest && length(newest) >= MINUTE_S && !newest.verdict?.faults.length;
  const picked = chosen ?? new Set(usable ? [newest.id] : []);
  const total = (sessions.data ?? []).filter((s) => picked.has(s.id)).reduce((sum, s) => sum + length(s), 0);
  // As the box shows it: what is proposed may have changed since it was drawn.
  const pick = (id: string, wanted: boolean) => {
    const next = new Set(picked);
    if (wanted) next.add(id);
    else next.delete(id);
    setChosen(next);
  };
  const learn = async () => {
    for (const session of sessions.data ?? [])
      if (picked.has(session.id) && session.state === "open") await api.endSession(session.id);
    const begun = await api.calibrate(asset.name, [...picked]);
    setJob(begun);
    const settled = await until(() => api.calibration(asset.name, begun.id), isSettled, setJob);
    if (settled.state === "done") {
      setJob(await api.activate(asset.name, settled.id));
      await changed();
    }
  };
  return (
    <div class="pair">
      <section class="card">
        <h2>From a healthy minute</h2>
        <p>
          Let the ball roll all over the plate for a minute or two: circles, figures of eight. The rig must be
          healthy while it does; what it does now is what it is held to later. A ball that rests teaches
          nothing.
        </p>
        <Trouble error={sessions.error} />
        {sessions.data?.length === 0 && (
          <p class="note">
            There is no session yet.{" "}
            <Link to={`${at("rigs", asset.name, "set-up")}?step=connect`}>Connect the rig</Link> first, or{" "}
            <Link to={`/sessions?asset=${encodeURIComponent(asset.name)}`}>import a recording</Link>.
          </p>
        )}
        <ul class="choose">
          {sessions.data?.map((session) => (
            <li>
              <label class="check">
                <input
                  type="checkbox"
                  checked={picked.has(session.id)}
                  onChange={(event) => pick(session.id, event.currentTarget.checked)}
                />
                <span>
                  <b>{session.name}</b>
                  {session.state === "open" && <span class="status-open"> ● recording</span>}
                  <br />
                  <span class="quiet">
                    {clock(session.opened_at)}, {duration(length(session))}
                    {session.verdict?.faults.length ? `, found: ${session.verdict.faults.join(", ")}` : ""}
                  </span>
                </span>
              </label>
            </li>
          ))}
        </ul>
        {picked.size > 0 && (
          <p role="status">
            {duration(total)} chosen{total < MINUTE_S ? `; a minute is better` : ""}.{" "}
            <progress value={Math.min(total, MINUTE_S)} max={MINUTE_S} aria-label="Share of a minute" />
          </p>
        )}
        <div class="form-end">
          <Act class="primary" act={learn} disabled={picked.size === 0}>
            Learn from {picked.size === 1 ? "it" : "them"}
          </Act>
        </div>
      </section>
      <Learnt asset={asset} job={job} />
    </div>
  );
}

function Learnt({ asset, job }: { asset: Asset; job?: CalibrationJob }) {
  const c = asset.calibration;
  return (
    <section class="card">
      <h2>What was learnt</h2>
      {job && !isSettled(job) && (
        <p role="status">
          <span class="spinner" aria-hidden="true" /> Learning…
        </p>
      )}
      {job?.state === "failed" && (
        <p class="trouble" role="alert">
          {job.error}
        </p>
      )}
      {job?.state === "done" && (
        <p class="wait wait-good" role="status">
          <b>Learnt.</b> The next session is judged by it.
        </p>
      )}
      {!c && !job && <p class="quiet">Nothing yet. Until then only large faults are found.</p>}
      {c && (
        <>
          <table class="numbers">
            <thead>
              <tr>
                <th scope="col">from {count(c.samples)} samples</th>
                <th scope="col" class="n">
                  x
                </th>
                <th scope="col" class="n">
                  y
                </th>
              </tr>
            </thead>
            <tbody>
              {(
                [
                  ["Gain: measured over modelled acceleration", (a) => number(a.gain, 3)],
                  ["Dead time of the servo", (a) => number(a.dead_time_s * 1e3, 0, "ms")],
                  ["Lag of the servo", (a) => number(a.lag_s * 1e3, 0, "ms")],
                  ["Plate angle at command 0", (a) => degrees(a.level_rad, 2)],
                  ["Noise of the readings", (a) => millimetres(a.noise_m, 2)],
                  [
                    "Tilt at which a resting ball starts",
                    (a) => (a.rest_s ? degrees(a.breakaway_rad, 2) : "unknown"),
                  ],
                  ["Residual of a healthy rig, rms", (a) => number(a.residual_m_s2, 3, "m/s²")],
                ] as [string, (a: AxisCalibration) => string][]
              ).map(([word, show]) => (
                <tr>
                  <th scope="row">{word}</th>
                  <td class="n">{c.x ? show(c.x) : "–"}</td>
                  <td class="n">{c.y ? show(c.y) : "–"}</td>
                </tr>
              ))}
            </tbody>
          </table>
          {!!c.certificate?.length && <Promised certificate={c.certificate} />}
          <h3>What can be found, how fast</h3>
          {c.prospects ? (
            <Found prospects={c.prospects} />
          ) : (
            <p class="quiet">Not tried: the sessions are too short for it.</p>
          )}
          <p>Slower changes are followed over the sessions and warned of before they are faults.</p>
          <p>
            <Link class="button primary" to={at("rigs", asset.name)}>
              Done: see it live
            </Link>
          </p>
        </>
      )}
    </section>
  );
}

/** A rate per hour in the unit in which it is easiest to imagine. */
function rate(perHour?: number | null): string {
  if (perHour == null) return "unknown";
  const perDay = 24 * perHour;
  if (perDay >= 24) return `${number(perHour, 1)} an hour`;
  return perDay >= 1 ? `${number(perDay, 1)} a day` : `one in ${number(1 / perDay, 0)} days`;
}

/** How near each monitor came to an alarm on healthy recordings that it had not learnt from, and how often it will. */
function Promised({ certificate }: { certificate: MonitorCertificate[] }) {
  return (
    <>
      <h3>False alarms to expect</h3>
      <table class="numbers">
        <thead>
          <tr>
            <th scope="col">tested on recordings not learnt from</th>
            <th scope="col" class="n">
              judged
            </th>
            <th scope="col" class="n">
              nearest to an alarm
            </th>
            <th scope="col" class="n">
              false alarms
            </th>
          </tr>
        </thead>
        <tbody>
          {certificate.map((m) => (
            <tr>
              <th scope="row">{codeTitle(m.code)}</th>
              <td class="n">{seconds(m.judged_s, 0)}</td>
              <td class="n">{number(m.nearest * 100, 0, "%")}</td>
              <td class="n">{rate(m.alarms_per_hour)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </>
  );
}

/** How soon a fault would have been confirmed, had it come during the sessions learnt from. */
function Found({ prospects: p }: { prospects: Prospects }) {
  const after = (s?: number | null) => (s == null ? "not in 10 s" : seconds(s, 1));
  const rows: [string, (s: ServoProspects) => string][] = [
    ["A servo that answers nothing", (s) => after(s.dead_s)],
    ["One that answers half", (s) => after(s.half_gain_s)],
    ["One whose horn has slipped by 1°", (s) => after(s.offset_1deg_s)],
    [
      "Smallest loss of its answer that is found",
      (s) => (s.least_gain_loss == null ? "–" : number(s.least_gain_loss * 100, 0, "%")),
    ],
    [
      "Smallest slip that is found",
      (s) => (s.least_offset_rad == null ? "–" : degrees(s.least_offset_rad, 1)),
    ],
  ];
  return (
    <>
      <table class="numbers">
        <thead>
          <tr>
            <th scope="col">confirmed after, median of {p.trials} trials</th>
            <th scope="col" class="n">
              x
            </th>
            <th scope="col" class="n">
              y
            </th>
          </tr>
        </thead>
        <tbody>
          {rows.map(([word, show]) => (
            <tr>
              <th scope="row">{word}</th>
              <td class="n">{p.x ? show(p.x) : "–"}</td>
              <td class="n">{p.y ? show(p.y) : "–"}</td>
            </tr>
          ))}
          <tr>
            <th scope="row">A ball that sticks</th>
            <td class="n" colSpan={2}>
              {after(p.stuck_s)}
            </td>
          </tr>
          <tr>
            <th scope="row">Readings that freeze</th>
            <td class="n" colSpan={2}>
              {after(p.frozen_s)}
            </td>
          </tr>
          <tr>
            <th scope="row">No ball seen</th>
            <td class="n" colSpan={2}>
              {after(p.unseen_s)}
            </td>
          </tr>
        </tbody>
      </table>
      <p class="quiet">
        Each fault was put into the sessions that were learnt from, at {p.trials} moments: with more motion,
        smaller faults are found, and sooner.
      </p>
    </>
  );
}
