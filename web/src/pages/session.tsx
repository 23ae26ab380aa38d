/** One session: played back in pictures and charts, judged again with other settings. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { api, isSettled, until } from "../api/client";
import type { Asset, FaultLine, Judged, Replay, Session } from "../api/types";
import { useAsk, useFrames, useTitle } from "../hooks";
import { TraceBuffer } from "../live/buffer";
import { Act, Dialogue, Facts, Loading, Trouble } from "../parts/bits";
import type { Mark } from "../parts/line-chart";
import { ChartGroup, RigCharts } from "../parts/rig-charts";
import { RigView, save } from "../parts/rig-view";
import { XyTrace } from "../parts/xy-trace";
import { at, go, Link, usePlace } from "../router";
import {
  alike,
  clock,
  codeTitle,
  count,
  duration,
  faultTitle,
  isFailing,
  judged,
  seconds,
  sentence,
  verdict,
} from "../words";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10] as const;
const SPANS = [10, 30, 60, 0] as const;
const TAIL_S = 4;
const CHART_EVERY = 2;

/** Moments of a whole session that are drawn; a longer one is thinned out. */
const POINTS = 12_000;

export function SessionPage({ id }: { id: string }) {
  const session = useAsk(() => api.session(id), id);
  const asset = useAsk(
    () => (session.data ? api.asset(session.data.asset) : new Promise<Asset>(() => {})),
    session.data?.asset,
  );
  const faults = useAsk(() => api.sessionFaults(id), `${id} faults`);
  useTitle(session.data ? `${session.data.name}` : "Session");
  if (!session.data || !asset.data) {
    const error = session.error ?? asset.error;
    return (
      <main>
        {error ? (
          <>
            <h1>Session</h1>
            <Trouble error={error} again={() => void session.again()} />
          </>
        ) : (
          <Loading what="the session" />
        )}
      </main>
    );
  }
  return (
    <Player session={session.data} asset={asset.data} faults={faults.data ?? []} again={session.again} />
  );
}

const marksOf = (faults: FaultLine[]): Mark[] =>
  faults.map((line) => ({
    t: line.t_s,
    label: `${codeTitle(line.code)} ${line.status}`,
    colour: !isFailing(line)
      ? "quiet"
      : line.status === "confirmed"
        ? "bad"
        : line.status === "pending"
          ? "warn"
          : "quiet",
  }));

function Player({
  session,
  asset,
  faults,
  again,
}: {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
  again: () => Promise<void>;
}) {
  const { query } = usePlace();
  const [profile, setProfile] = useState("");
  const [deleting, setDeleting] = useState(false);
  const trace = useAsk(
    () => api.trace(session.id, { points: POINTS, profile: profile || undefined }),
    `${session.id} ${profile}`,
  );
  const buffer = useMemo(() => (trace.data ? TraceBuffer.of(trace.data) : undefined), [trace.data]);
  const group = useMemo(() => new ChartGroup(), []);
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState<number>(1);
  const [span, setSpan] = useState<number>(30);
  const t = useRef(NaN);
  const slider = useRef<HTMLInputElement>(null);
  const words = useRef<HTMLOutputElement>(null);
  const drawn = useRef("");
  const frame = useRef(0);
  const before = useRef(0);

  useEffect(() => group.setMarks(marksOf(faults)), [faults]);
  useEffect(() => {
    if (!buffer?.t.length) return;
    const wanted = Number(query.get("t") ?? NaN);
    if (Number.isNaN(t.current))
      t.current = Number.isFinite(wanted) && query.has("t") ? wanted : buffer.first;
    drawn.current = "";
  }, [buffer]);

  const seek = (to: number) => {
    if (buffer) t.current = Math.min(Math.max(to, buffer.first), buffer.last);
  };
  useFrames((now) => {
    const dt = Math.min((now - before.current) / 1000, 0.1);
    before.current = now;
    if (!buffer?.t.length) return;
    if (playing) {
      t.current += dt * speed;
      if (t.current >= buffer.last) {
        t.current = buffer.last;
        setPlaying(false);
      }
    }
    const key = `${t.current.toFixed(3)} ${span}`;
    if (key === drawn.current || frame.current++ % CHART_EVERY) return;
    drawn.current = key;
    const range: [number, number] =
      span === 0 ? [buffer.first, buffer.last] : [Math.max(buffer.first, t.current - span * 0.6), 0];
    if (span !== 0) range[1] = Math.min(range[0] + span, Math.max(buffer.last, range[0] + 1));
    group.draw(buffer, range, t.current);
    if (slider.current) {
      slider.current.value = String(t.current);
      slider.current.setAttribute("aria-valuetext", seconds(t.current));
    }
    if (words.current) words.current.textContent = `${t.current.toFixed(2)} s`;
  });
  const pose = () => {
    if (!buffer?.t.length) return null;
    const place = (key: "position" | "twinPosition") => {
      const x = buffer.at("x", key, t.current),
        y = buffer.at("y", key, t.current);
      return x === null || y === null ? null : { x, y };
    };
    return {
      qx: buffer.at("y", "plate", t.current) ?? 0,
      qy: buffer.at("x", "plate", t.current) ?? 0,
      ball: place("position"),
      ghost: place("twinPosition"),
    };
  };
  const toggle = () => {
    if (!playing && buffer && t.current >= buffer.last) t.current = buffer.first;
    setPlaying(!playing);
  };
  const hotkeys = (event: KeyboardEvent) => {
    if ((event.target as HTMLElement).closest("input, select, button, canvas, a")) return;
    const steps: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1 };
    if (event.key === " ") {
      event.preventDefault();
      toggle();
    }
    if (steps[event.key]) {
      event.preventDefault();
      seek(t.current + steps[event.key]!);
    }
  };
  useEffect(() => {
    addEventListener("keydown", hotkeys);
    return () => removeEventListener("keydown", hotkeys);
  });

  return (
    <main class="asset">
      <header class="page-head">
        <div>
          <p class="crumbs">
            <Link to="/sessions">Sessions</Link> / <Link to={at("rigs", session.asset)}>{session.asset}</Link>
          </p>
          <h1>{session.name}</h1>
        </div>
        <div class="page-tools">
          <Act
            act={async () => save(await api.recording(session.id), `${session.asset}-${session.name}.csv`)}
          >
            Download CSV
          </Act>
          {session.state === "open" ? (
            <Act act={() => api.endSession(session.id).then(again)}>End session</Act>
          ) : (
            <button type="button" onClick={() => setDeleting(true)}>
              Delete
            </button>
          )}
        </div>
      </header>
      {deleting && (
        <Dialogue title="Delete this session?" close={() => setDeleting(false)}>
          <p>
            The recording of {count(session.samples)} samples and its verdict are gone for good. The rig's
            fault memory keeps what the session left in it.
          </p>
          <div class="form-end">
            <button type="button" onClick={() => setDeleting(false)}>
              Keep it
            </button>
            <Act
              class="danger"
              act={async () => {
                await api.deleteSession(session.id);
                go("/sessions");
              }}
            >
              Delete
            </Act>
          </div>
        </Dialogue>
      )}
      <Trouble error={trace.error} again={() => void trace.again()} />
      {!trace.data && !trace.error && <Loading what="the recording" />}
      {buffer && buffer.t.length === 0 && <p class="note">Nothing has been recorded in this session.</p>}
      {buffer && buffer.t.length > 0 && (
        <>
          <div class="live-top">
            <RigView asset={asset} pose={pose} name={`${session.asset}-${session.name}`} />
            <div class="live-side">
              <section class="card">
                <h2>From above</h2>
                <XyTrace asset={asset} moment={() => ({ buffer, t: t.current, tail: TAIL_S })} />
              </section>
              <Found session={session} faults={faults} seek={seek} />
            </div>
          </div>
          <section class="card">
            <div class="player">
              <button
                type="button"
                class="primary play"
                onClick={toggle}
                aria-label={playing ? "Pause" : "Play"}
              >
                {playing ? "❚❚" : "▶"}
              </button>
              <input
                ref={slider}
                type="range"
                class="scrub"
                min={buffer.first}
                max={buffer.last}
                step={0.01}
                aria-label="Moment"
                onInput={(e) => seek(Number(e.currentTarget.value))}
              />
              <output ref={words} class="n clock" />
              <label class="inline">
                Speed{" "}
                <select value={speed} onChange={(e) => setSpeed(Number(e.currentTarget.value))}>
                  {SPEEDS.map((s) => (
                    <option value={s}>{s}×</option>
                  ))}
                </select>
              </label>
              <label class="inline">
                Show{" "}
                <select value={span} onChange={(e) => setSpan(Number(e.currentTarget.value))}>
                  {SPANS.map((s) => (
                    <option value={s}>{s ? `${s} s` : "all"}</option>
                  ))}
                </select>
              </label>
              <label class="inline">
                Judged by{" "}
                <select value={profile} onChange={(e) => setProfile(e.currentTarget.value)}>
                  <option value="">as recorded</option>
                  <option value="default">default</option>
                  <option value="textbook">textbook</option>
                </select>
              </label>
            </div>
            <RigCharts
              group={group}
              kinds={["residual", "acceleration", "command", "position"]}
              height={136}
              onSeek={seek}
            />
            <p class="quiet small-text">
              Click a chart to go there; space plays, arrow keys step by a second.
            </p>
          </section>
        </>
      )}
      <JudgeAgain session={session} />
    </main>
  );
}

function Found({
  session,
  faults,
  seek,
}: {
  session: Session;
  faults: FaultLine[];
  seek: (t: number) => void;
}) {
  return (
    <section class="card">
      <h2>What was found</h2>
      <Facts
        of={[
          ["State", session.state === "open" ? "open" : `ended ${clock(session.ended_at)}`],
          [
            "Samples",
            `${count(session.samples)}${session.rejected ? `, ${count(session.rejected)} rejected` : ""}`,
          ],
          [
            "Length",
            duration(
              session.first_t_s != null && session.last_t_s != null
                ? session.last_t_s - session.first_t_s
                : null,
            ),
          ],
          [
            "Hash",
            session.verdict ? (
              <code title={session.verdict.verdict_hash}>{session.verdict.verdict_hash.slice(0, 12)}</code>
            ) : (
              "once it has ended"
            ),
          ],
        ]}
      />
      {session.verdict ? (
        <p class={verdict(session.verdict).look}>{verdict(session.verdict).text}</p>
      ) : (
        faults.length === 0 && <p class="quiet">No fault so far</p>
      )}
      {faults.length > 0 && (
        <ol class="found">
          {faults.map((line) => (
            <li>
              <button
                type="button"
                class="link n"
                onClick={() => seek((line.onset_s ?? line.t_s) - 0.5)}
                aria-label={`Go to ${seconds(line.t_s)}`}
              >
                {seconds(line.t_s)}
              </button>{" "}
              <span>
                <b>{alike(line.candidates) || faultTitle(line.code, line.kind)}</b>{" "}
                <span class={isFailing(line) ? `status-${line.status}` : "quiet"}>
                  {isFailing(line) || line.status === "cleared" || line.status === "healed"
                    ? line.status
                    : "passes again"}
                </span>
                <br />
                <span class="quiet">{sentence(line.summary)}</span>
              </span>
            </li>
          ))}
        </ol>
      )}
      {session.verdict && <JudgedShares monitors={session.verdict.monitors ?? []} />}
    </section>
  );
}

/** How much of the session each monitor could judge, and what it came to. */
function JudgedShares({ monitors }: { monitors: Judged[] }) {
  if (monitors.length === 0) return null;
  return (
    <table class="list judged">
      <caption class="quiet small-text">Judged, of the session</caption>
      <thead>
        <tr>
          <th scope="col">Monitor</th>
          <th scope="col" class="n">
            Judged
          </th>
          <th scope="col">Outcome</th>
        </tr>
      </thead>
      <tbody>
        {monitors.map((m) => (
          <tr>
            <th scope="row">{codeTitle(m.code)}</th>
            <td class="n">{judged(m)}</td>
            <td>{m.outcome}</td>
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function JudgeAgain({ session }: { session: Session }) {
  const [profile, setProfile] = useState("textbook");
  const [debounce, setDebounce] = useState("");
  const [unlearnt, setUnlearnt] = useState(false);
  const [replay, setReplay] = useState<Replay>();
  const run = async () => {
    const patch = {
      ...(debounce ? { diagnostics: { debounce_s: Number(debounce) } } : {}),
      ...(unlearnt ? { calibration: null } : {}),
    };
    const begun = await api.replay(session.id, {
      ...(profile ? { profile } : {}),
      ...(Object.keys(patch).length ? { asset: patch } : {}),
    });
    setReplay(begun);
    await until(() => api.replayState(begun.id), isSettled, setReplay);
  };
  const result = replay?.result;
  return (
    <section class="card">
      <h2>Judge it again</h2>
      <p class="quiet">With other settings, on the same samples. Nothing of the session changes.</p>
      <div class="form-row">
        <label>
          Profile{" "}
          <select value={profile} onChange={(e) => setProfile(e.currentTarget.value)}>
            <option value="">as recorded</option>
            <option value="default">default</option>
            <option value="textbook">textbook</option>
          </select>
        </label>
        <label>
          Debounce, s{" "}
          <input
            type="number"
            min="0"
            max="60"
            step="0.1"
            placeholder="as recorded"
            value={debounce}
            onInput={(e) => setDebounce(e.currentTarget.value)}
          />
        </label>
        <label class="check">
          <input type="checkbox" checked={unlearnt} onChange={(e) => setUnlearnt(e.currentTarget.checked)} />{" "}
          without what was learnt
        </label>
        <Act class="primary" act={run}>
          Judge again
        </Act>
      </div>
      {replay && !isSettled(replay) && (
        <p role="status">
          Judging… <progress value={replay.progress} max={1} aria-label="Share judged" />
        </p>
      )}
      {replay?.error && (
        <p class="trouble" role="alert">
          {replay.error}
        </p>
      )}
      {result && (
        <div class="verdicts">
          <p role="status" class={result.same ? "status-ok" : "status-pending"}>
            {result.same
              ? "The same verdict, transition by transition."
              : `Another verdict: ${count(result.differences.length)} differences.`}
          </p>
          <div class="pair">
            <Facts
              of={[
                ["Recorded", session.verdict ? verdict(session.verdict).text : "once it has ended"],
                ["Hash", <code>{result.recorded_hash?.slice(0, 12) ?? "–"}</code>],
              ]}
            />
            <Facts
              of={[
                ["Judged again", verdict(result.summary).text],
                ["Hash", <code>{result.summary.verdict_hash.slice(0, 12)}</code>],
              ]}
            />
          </div>
          {result.differences.length > 0 && (
            <div class="scroll differences" tabIndex={0} role="region" aria-label="Differences">
              <table class="list">
                <thead>
                  <tr>
                    <th class="n">At</th>
                    <th>Recorded</th>
                    <th>Judged again</th>
                  </tr>
                </thead>
                <tbody>
                  {result.differences.slice(0, 200).map(({ recorded, replayed }) => (
                    <tr>
                      <td class="n">{seconds((recorded ?? replayed)?.t_s)}</td>
                      {[recorded, replayed].map((line) => (
                        <td>
                          {line ? (
                            <>
                              {faultTitle(line.code, line.kind)}{" "}
                              <span class={`status-${line.status}`}>{line.status}</span>
                            </>
                          ) : (
                            <span class="quiet">–</span>
                          )}
                        </td>
                      ))}
                    </tr>
                  ))}
                </tbody>
              </table>
            </div>
          )}
        </div>
      )}
    </section>
  );
}
