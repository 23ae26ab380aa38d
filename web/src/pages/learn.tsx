/** The demo's buttons, and what there is to learn: why a textbook's limit fails, what speed costs. */
import { useEffect, useMemo, useState } from "preact/hooks";
import { api, isSettled, until } from "../api/client";
import type { Replay, Session, Trace } from "../api/types";
import { useAsk, useTitle } from "../hooks";
import { TraceBuffer } from "../live/buffer";
import { Act, Facts, Loading, Trouble } from "../parts/bits";
import { ChartGroup, RigCharts } from "../parts/rig-charts";
import { at, Link } from "../router";
import { codeTitle, count, duration, kindMeaning, number, verdict } from "../words";

export function LearnPage({ demo }: { demo: boolean }) {
  useTitle(demo ? "Demo" : "Learn");
  return (
    <main>
      <h1>{demo ? "Break it" : "Learn"}</h1>
      {demo ? (
        <Buttons />
      ) : (
        <p class="note">
          In <code>offbd demo</code> this page breaks a simulated rig at the press of a button.
        </p>
      )}
      <Textbook />
      <Charts />
    </main>
  );
}

function Buttons() {
  const demo = useAsk(api.demo, "demo", 700);
  if (!demo.data) return demo.error ? <Trouble error={demo.error} /> : <Loading what="the demo" />;
  const { asset, broken, buttons, script } = demo.data;
  const codes = [...new Set(buttons.map((button) => button.split(":")[0]!))];
  const then = (act: () => Promise<unknown>) => () => act().then(demo.again);
  return (
    <section class="card">
      <div class="card-head">
        <p class="grow" role="status">
          {broken.length ? (
            <>
              Broken now: <b>{broken.map((each) => each.replace(":", ", ").replace("_", " ")).join("; ")}</b>.
            </>
          ) : (
            "The simulated rig is whole."
          )}{" "}
          <span class="quiet">
            {script
              ? "A script breaks and repairs it by itself until you press a button."
              : "It is in your hands."}
          </span>
        </p>
        <div class="page-tools">
          <Link class="button primary" to={at("rigs", asset)}>
            Watch {asset}
          </Link>
          <Act act={then(api.demoRepair)}>Repair all</Act>
          <Act act={then(api.demoScript)} disabled={script}>
            Back to the script
          </Act>
        </div>
      </div>
      <div class="breakers">
        {codes.map((code) => (
          <fieldset>
            <legend>{codeTitle(code)}</legend>
            {buttons
              .filter((button) => button.startsWith(`${code}:`))
              .map((button) => {
                const kind = button.split(":")[1]!;
                return (
                  <Act
                    class={broken.includes(button) ? "danger" : ""}
                    act={then(() => api.demoBreak(button))}
                    label={`Break: ${codeTitle(code)}, ${kind}`}
                  >
                    <b>{kind}</b>
                    <br />
                    <span class="quiet small-text">{kindMeaning(kind)}</span>
                  </Act>
                );
              })}
          </fieldset>
        ))}
      </div>
      <p class="quiet small-text">
        A fault shows as soon as the rig is asked to do what it no longer can: mostly within one to three
        seconds. It stays on record when the rig is repaired; clear it on its page.
      </p>
    </section>
  );
}

/** Seconds of a session that the comparison shows. */
const SHOWN_S = 20;

function Textbook() {
  const sessions = useAsk(
    () => api.sessions({ limit: 50 }).then((page) => page.items.filter((s) => s.samples > 500)),
    "sessions",
    10_000,
  );
  const [id, setId] = useState("");
  const isWhole = (s: Session) => s.verdict?.faults.length === 0;
  const chosen =
    sessions.data?.find((s) => s.id === id) ??
    sessions.data?.find((s) => isWhole(s) && s.asset === "demo-rig") ??
    sessions.data?.find(isWhole) ??
    sessions.data?.find((s) => s.state === "ended") ??
    sessions.data?.[0];
  return (
    <section class="card">
      <h2>Why 0.01 m/s² fails on a real rig</h2>
      <p>
        The book chapter's rule calls it a fault when measured and simulated acceleration differ by 0.01 m/s².
        On a simulation without noise that works. A camera that sees the ball to a fraction of a millimetre,
        differentiated twice, is off by far more than that, all the time. Below, one session without a fault,
        judged by both: by the profile <b>default</b>, whose limit follows from the noise and which waits
        until a deviation lasts, and by <b>textbook</b>, the rule to the letter: it looks only while the
        command is beyond 4.6° or the acceleration beyond 0.5 m/s², and then raises an alarm at once.
      </p>
      <Trouble error={sessions.error} />
      {sessions.data?.length === 0 && (
        <p class="note">
          There is no session to show it on yet. Run <code>offbd demo</code>, or import a recording.
        </p>
      )}
      {chosen && (
        <>
          <label class="inline">
            Session{" "}
            <select value={chosen.id} onChange={(e) => setId(e.currentTarget.value)}>
              {sessions.data!.map((s) => (
                <option value={s.id}>
                  {s.asset}: {s.name}
                </option>
              ))}
            </select>
          </label>
          <div class="pair">
            {["default", "textbook"].map((profile) => (
              <Judged key={chosen.id + profile} session={chosen} profile={profile} />
            ))}
          </div>
        </>
      )}
    </section>
  );
}

/** Shares along x: of the moments beyond the limit, of those judged, and of these beyond it. */
function shares({ x: { measured_m_s2: m, twin_m_s2: t, limit_m_s2: limit, enabled } }: Trace) {
  const known = m.flatMap((value, i) => (value != null && t[i] != null ? [i] : []));
  const over = (i: number) => Math.abs(m[i]! - t[i]!) >= limit[i]!;
  const judged = known.filter((i) => enabled[i]);
  const share = (some: number[], of: number[]) => (of.length ? some.length / of.length : null);
  return {
    beyond: share(known.filter(over), known),
    judged: share(judged, known),
    false: share(judged.filter(over), judged),
  };
}

const percent = (share?: number | null) => number(share == null ? share : 100 * share, 0, "%");

function Judged({ session, profile }: { session: Session; profile: string }) {
  const from = session.first_t_s ?? 0;
  const trace = useAsk(
    () => api.trace(session.id, { from_s: from, to_s: from + SHOWN_S, profile }),
    `${session.id} ${profile}`,
  );
  const [replay, setReplay] = useState<Replay>();
  const group = useMemo(() => new ChartGroup(), []);
  useEffect(() => {
    if (!trace.data) return;
    const buffer = TraceBuffer.of(trace.data);
    if (buffer.t.length) group.draw(buffer, [buffer.first, buffer.last]);
  }, [trace.data]);
  const judge = async () => {
    const begun = await api.replay(session.id, { profile });
    await until(() => api.replayState(begun.id), isSettled, setReplay);
  };
  const found = replay?.result;
  const share = useMemo(() => trace.data && shares(trace.data), [trace.data]);
  return (
    <div>
      <h3>{profile}</h3>
      <Trouble error={trace.error} again={() => void trace.again()} />
      <RigCharts group={group} kinds={["residual"]} axes={["x"]} height={170} />
      <Facts
        of={[
          ["Beyond the limit", percent(share?.beyond)],
          ["Judged: the gate is open", percent(share?.judged)],
          [
            "Beyond the limit, of what is judged",
            share && !share.judged ? "nothing: the gate never opened" : percent(share?.false),
          ],
          [
            "Whole session",
            found ? verdict(found.summary).text : replay ? "judging…" : <Act act={judge}>Judge it all</Act>,
          ],
          ["Changes of status", found ? count(found.faults.length) : "–"],
        ]}
      />
      <p class="quiet small-text">
        The first {duration(Math.min(SHOWN_S, session.last_t_s! - from))}, x axis.
      </p>
    </div>
  );
}

const PICTURES = import.meta.glob<string>("../../../docs/charts/*.png", {
  eager: true,
  query: "?url",
  import: "default",
});

const CHARTS: [string, string, string][] = [
  [
    "work-precision",
    "Speed against accuracy, beside other libraries",
    "CPU time for a simulated second against the error of the ball's position, on six scenes. Down and left is better.",
  ],
  [
    "work-precision-models",
    "Speed against accuracy, model by model",
    "The ladder from small angles over rolling, creeping and sliding to spring and damper.",
  ],
  ["fidelity", "Which model where", "The cheapest model that keeps within the wanted accuracy, by scene."],
  ["stability", "Where methods break", "Step against stiffness: where each method stays stable."],
  [
    "estimators",
    "How to differentiate noise",
    "Error against delay of the filters that could measure acceleration.",
  ],
];

function Charts() {
  const address = (name: string) =>
    Object.entries(PICTURES).find(([path]) => path.endsWith(`/${name}.png`))?.[1];
  const there = CHARTS.filter(([name]) => address(name));
  return (
    <section class="card" id="charts">
      <h2>Speed against accuracy</h2>
      <p>
        The twin runs the cheapest model that is good enough. What that choice is made from was measured;{" "}
        <code>offbd chart work-precision</code> measures it on your machine.
      </p>
      {there.length === 0 && (
        <p class="note">
          This program was built without the pictures; they are in docs/charts of the repository.
        </p>
      )}
      <div class="gallery">
        {there.map(([name, title, text]) => (
          <figure>
            <a href={address(name)} target="_blank" rel="noopener">
              <img src={address(name)} alt={`${title}. ${text}`} loading="lazy" />
            </a>
            <figcaption>
              <b>{title}</b>
              <br />
              <span class="quiet">{text}</span>
            </figcaption>
          </figure>
        ))}
      </div>
    </section>
  );
}
