/** One fault: what was seen, what it may be, since when, and what people did about it. */
import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useState } from "preact/hooks";
import { actor, rememberActor } from "../api/access";
import { api } from "../api/client";
import { events } from "../api/events";
import type { Around as Recording, FaultEntry, History } from "../api/types";
import { useAsk, useTitle } from "../hooks";
import { TraceBuffer } from "../live/buffer";
import { Act, Empty, Facts, Loading, StatusChip, Trouble } from "../parts/bits";
import { EvidenceTable } from "../parts/evidence";
import type { Mark } from "../parts/line-chart";
import { ChartGroup, RigCharts } from "../parts/rig-charts";
import { save } from "../parts/rig-view";
import { at, Link } from "../router";
import {
  clock,
  codeMeaning,
  codeTitle,
  faultTitle,
  judged,
  kindMeaning,
  seconds,
  sentence,
  STATUS_BITS,
} from "../words";

/** Seconds shown before and after the occurrence. */
const BEFORE_S = 6;
const AFTER_S = 6;

export function FaultPage({ name, code }: { name: string; code: string }) {
  useTitle(`${codeTitle(code)} of ${name}`);
  const fault = useAsk(() => api.fault(name, code), `${name} ${code}`, 5000);
  const history = useAsk(
    () => api.history(name, code).then((page) => page.items),
    `${name} ${code} history`,
    5000,
  );
  const again = async () => void (await Promise.all([fault.again(), history.again()]));
  useEffect(
    () =>
      events.listen((line) => {
        if (line.asset === name && line.code === code) void again();
      }),
    [name, code],
  );
  if (!fault.data)
    return (
      <main>
        {fault.error ? (
          <>
            <h1>{codeTitle(code)}</h1>
            <Trouble error={fault.error} again={() => void again()} />
          </>
        ) : (
          <Loading what="the fault" />
        )}
      </main>
    );
  return (
    <Shown
      fault={fault.data}
      history={history.data ?? []}
      error={fault.error ?? history.error}
      again={again}
    />
  );
}

function Shown({
  fault,
  history,
  error,
  again,
}: {
  fault: FaultEntry;
  history: History[];
  error: unknown;
  again: () => Promise<void>;
}) {
  const { asset, code } = fault;
  const isOn = fault.status === "pending" || fault.status === "confirmed";
  const latest = history.find(
    (entry) => entry.fault && (entry.what === "confirmed" || entry.what === "pending"),
  );
  return (
    <main class="fault">
      <header class="page-head">
        <div>
          <p class="crumbs">
            <Link to="/">Fleet</Link> / <Link to={at("rigs", asset)}>{asset}</Link>
          </p>
          <h1>
            {faultTitle(code, fault.kind)} <StatusChip {...fault} />
          </h1>
        </div>
        {isOn && <Acts fault={fault} again={again} />}
      </header>
      <Trouble error={error} />
      {latest?.fault && isOn ? (
        <p class="sentence">{sentence(latest.fault.summary)}</p>
      ) : (
        <Empty title={fault.status === "cleared" ? "Nothing is on record" : "On record, but not active"}>
          <p>
            {codeTitle(code)}: {codeMeaning(code)}.{" "}
            {fault.status === "healed"
              ? "Enough good sessions followed, so it has healed."
              : "Nothing of it has been found since it was last cleared."}
          </p>
        </Empty>
      )}
      <div class="pair">
        <div class="column">
          <Causes fault={fault} />
          <Timeline history={history} fault={fault} />
        </div>
        <div class="column">
          <StatusByte byte={fault.status_byte} />
          <Monitor fault={fault} />
        </div>
      </div>
      {fault.last_occurrence && (
        <Around key={`${fault.last_occurrence.session_id} ${fault.onset_s}`} fault={fault} />
      )}
      {fault.freeze_frame && (
        <section class="card">
          <h2>Freeze frame</h2>
          <p class="quiet small-text">The numbers at the first failure of the current occurrence.</p>
          <EvidenceTable of={fault.freeze_frame} />
        </section>
      )}
    </main>
  );
}

function Acts({ fault, again }: { fault: FaultEntry; again: () => Promise<void> }) {
  const [name, setName] = useState(actor());
  const act = (what: () => Promise<unknown>) => async () => {
    rememberActor(name);
    await what();
    await again();
  };
  return (
    <div class="page-tools">
      <label class="inline">
        as{" "}
        <input
          value={name}
          size={12}
          maxLength={60}
          onInput={(e) => setName(e.currentTarget.value)}
          aria-label="Your name, kept with what you do"
        />
      </label>
      <Act
        class="primary"
        disabled={fault.acknowledged}
        act={act(() => api.acknowledge(fault.asset, fault.code))}
      >
        {fault.acknowledged ? "Acknowledged" : "Acknowledge"}
      </Act>
      <Act act={act(() => api.clear(fault.asset, fault.code))}>Clear</Act>
    </div>
  );
}

function Causes({ fault }: { fault: FaultEntry }) {
  const candidates = fault.candidates.length
    ? fault.candidates
    : fault.status === "cleared"
      ? []
      : [{ code: fault.code, kind: fault.kind, weight: 1 }];
  return (
    <section class="card">
      <h2>What it may be</h2>
      {candidates.length === 0 && <p class="quiet">Nothing is suspected.</p>}
      <ul class="candidates">
        {candidates.map((c) => (
          <li>
            <span>
              <b>{faultTitle(c.code, c.kind)}</b>
              <br />
              <span class="quiet">{c.kind ? kindMeaning(c.kind) : codeMeaning(c.code)}</span>
            </span>
            <meter min={0} max={1} value={c.weight} aria-label={`Weight of ${faultTitle(c.code, c.kind)}`} />
            <span class="n">{Math.round(c.weight * 100)} %</span>
          </li>
        ))}
      </ul>
      <Facts
        of={[
          ...(fault.axis ? [["Axis", `${fault.axis}, moved by ${fault.command}`] as Fact] : []),
          [
            "Occurrences",
            `${fault.occurrences} since the last clear, in ${plural(fault.failed_cycles ?? 0, "session")}`,
          ],
          ...occurrence("First", fault.first_occurrence, fault.first_onset_s),
          ...(fault.occurrences > 1 ? occurrence("Last", fault.last_occurrence, fault.last_onset_s) : []),
          ...(fault.last_occurrence
            ? [
                [
                  "Judged by",
                  fault.last_occurrence.calibration_id ? (
                    <>
                      calibration <code>{fault.last_occurrence.calibration_id}</code>
                    </>
                  ) : (
                    "a rig that has not been learnt"
                  ),
                ] as Fact,
                ["Settings", <code>{fault.last_occurrence.settings_id}</code>] as Fact,
              ]
            : []),
          [
            "Acknowledged",
            act(fault.acknowledgement, fault.occurrences ? "not yet" : "nothing to acknowledge"),
          ],
          ["Cleared", act(fault.cleared, "never")],
          ...(fault.status === "confirmed"
            ? [
                [
                  "Heals after",
                  `${plural(fault.healing_cycles ?? 0, "good session")}; there were ${fault.healing_counter ?? 0}`,
                ] as Fact,
              ]
            : []),
          ...(fault.status === "healed"
            ? [
                [
                  "Is erased after",
                  `${plural(fault.aging_cycles ?? 0, "good session")}; there were ${fault.aging_counter ?? 0}`,
                ] as Fact,
              ]
            : []),
          ["Last change", clock(fault.changed_at)],
        ]}
      />
    </section>
  );
}

type Fact = [string, ComponentChildren];

const plural = (n: number, word: string) => `${n} ${word}${n === 1 ? "" : "s"}`;

const act = (done: FaultEntry["cleared"], never: string) =>
  done ? (
    <>
      by <b>{done.by}</b>, {clock(done.at)}
    </>
  ) : (
    never
  );

/** When and in which session it failed anew. */
function occurrence(which: string, of: FaultEntry["last_occurrence"], onset?: number | null): Fact[] {
  if (!of) return [];
  const where = `${at("sessions", of.session_id)}${onset == null ? "" : `?t=${onset.toFixed(2)}`}`;
  return [
    [
      `${which} occurrence`,
      <>
        {clock(of.noted_at)}, {onset == null ? "in" : `${seconds(onset)} into the clock of`}{" "}
        <Link to={where}>{of.session}</Link>
      </>,
    ],
  ];
}

/** Where the test stands, and whether it has had the chance to find anything. */
function Monitor({ fault }: { fault: FaultEntry }) {
  const { monitor: m, in_use: use } = fault;
  const cycles = use?.cycles_with_data ?? 0;
  return (
    <section class="card">
      <h2>Its monitor</h2>
      <Facts
        of={[
          [
            "In this session",
            m
              ? `${m.complete_this_cycle ? "has come to a result" : "no result yet"}; judged ${judged(m)} of it`
              : "none is open",
          ],
          ...(m
            ? [
                [
                  "Fault detection counter",
                  `${m.counter}, of −128 (passed) to 127 (failed)`.replace("-", "−"),
                ] as Fact,
              ]
            : []),
          [
            "In-use ratio",
            use?.ratio == null
              ? "no session with enough data has ended yet"
              : `${Math.round(use.ratio * 100)} %: could have found it in ${use.cycles_judged} of ${plural(cycles, "session")} with enough data`,
          ],
        ]}
      />
      {use?.ratio != null && use.ratio < 0.5 && (
        <p class="note">A low ratio says that the gate is too strict for how this rig is used.</p>
      )}
    </section>
  );
}

function StatusByte({ byte }: { byte: string }) {
  const bits = Number.parseInt(byte, 16);
  return (
    <section class="card">
      <h2>
        Status byte <code>{byte}</code>
      </h2>
      <table class="bits">
        <thead class="hidden">
          <tr>
            <th>Bit</th>
            <th>Value</th>
            <th>Meaning</th>
          </tr>
        </thead>
        <tbody>
          {STATUS_BITS.map(({ bit, name, on, off }) => {
            const set = ((bits >> bit) & 1) === 1;
            return (
              <tr class={set ? "set" : ""}>
                <th scope="row">{bit}</th>
                <td class="bit">{set ? "1" : "0"}</td>
                <td>
                  <b>{name}</b>
                  <br />
                  {set ? on : off}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
      <p class="quiet small-text">ISO 14229-1, annex D.2. An operation cycle is a session.</p>
    </section>
  );
}

/** The seconds before and after the last occurrence, as recorded and as judged. */
function Around({ fault }: { fault: FaultEntry }) {
  const { asset, code } = fault;
  const asked = useAsk(
    () => api.around(asset, code, { before_s: BEFORE_S, after_s: AFTER_S }),
    `${asset} ${code} around`,
  );
  const recording = asked.data;
  // What comes after the fault in a session that runs is there a little later.
  useEffect(() => {
    if (!recording || recording.complete || recording.columns.t_s.at(-1)! >= recording.to_s - 0.5) return;
    const timer = setTimeout(() => void asked.again(), 1000);
    return () => clearTimeout(timer);
  }, [recording]);
  const session = fault.last_occurrence!;
  const axes =
    fault.axis === "x" || fault.axis === "y"
      ? ([fault.axis] as ("x" | "y")[])
      : (["x", "y"] as ("x" | "y")[]);
  const start = recording?.onset_s ?? recording?.failed_s;
  return (
    <section class="card">
      <div class="card-head">
        <h2>Before and after</h2>
        <div class="page-tools">
          {recording && (
            <button
              type="button"
              onClick={() =>
                save(
                  new Blob([JSON.stringify(recording)], { type: "application/json" }),
                  `${asset}-${code}.json`,
                )
              }
            >
              Save the evidence
            </button>
          )}
          <Link
            class="button"
            to={`${at("sessions", session.session_id)}${start == null ? "" : `?t=${start.toFixed(2)}`}`}
          >
            Play the session back
          </Link>
        </div>
      </div>
      <Trouble error={asked.error} again={() => void asked.again()} />
      {recording && <Seconds recording={recording} axes={axes} />}
    </section>
  );
}

function Seconds({ recording, axes }: { recording: Recording; axes: ("x" | "y")[] }) {
  const group = useMemo(() => new ChartGroup(), []);
  const buffer = useMemo(() => TraceBuffer.ofRecording(recording), [recording]);
  useEffect(() => {
    if (!buffer.t.length) return;
    const marks: Mark[] = [];
    if (recording.onset_s != null) marks.push({ t: recording.onset_s, label: "onset", colour: "ink" });
    marks.push({ t: recording.failed_s, label: "pending", colour: "warn" });
    if (recording.confirmed_s != null)
      marks.push({ t: recording.confirmed_s, label: "confirmed", colour: "bad" });
    group.setMarks(marks);
    group.draw(buffer, [
      Math.max(recording.from_s, buffer.first),
      Math.min(recording.to_s, Math.max(buffer.last, recording.failed_s + 1)),
    ]);
  }, [buffer]);
  return buffer.t.length ? (
    <RigCharts
      group={group}
      kinds={["residual", "acceleration", "command", "position"]}
      axes={axes}
      height={150}
      measuredOnly
    />
  ) : (
    <p class="quiet">The recording has nothing from these seconds.</p>
  );
}

const WHAT: Record<string, string> = {
  pending: "became pending",
  confirmed: "was confirmed",
  healed: "healed",
  cleared: "is off the record",
  acknowledge: "acknowledged",
  clear: "cleared",
};

function Timeline({ history, fault }: { history: History[]; fault: FaultEntry }) {
  return (
    <section class="card">
      <h2>Over time</h2>
      {history.length === 0 && <p class="quiet">It has never happened.</p>}
      <ol class="timeline">
        {history.map((entry) => (
          <li key={entry.id} class={`what-${entry.what}`}>
            <time dateTime={entry.at}>{clock(entry.at)}</time>
            {entry.by ? (
              <span>
                <b>{entry.by}</b> {WHAT[entry.what]} it
              </span>
            ) : (
              <span>
                {faultTitle(fault.code, entry.fault?.kind)} <b>{WHAT[entry.what] ?? entry.what}</b>
                {entry.fault && (
                  <>
                    {" "}
                    at {seconds(entry.fault.t_s)} of{" "}
                    {entry.session_id ? (
                      <Link
                        to={`${at("sessions", entry.session_id)}?t=${(entry.fault.onset_s ?? entry.fault.t_s).toFixed(2)}`}
                      >
                        {entry.fault.session}
                      </Link>
                    ) : (
                      entry.fault.session
                    )}
                  </>
                )}
              </span>
            )}
          </li>
        ))}
      </ol>
    </section>
  );
}
