/** One fault: what was seen, what it may be, since when, and what people did about it. */
import { useEffect, useMemo, useState } from "preact/hooks";
import { actor, rememberActor } from "../api/access";
import { api } from "../api/client";
import { events } from "../api/events";
import type { FaultEntry, History } from "../api/types";
import { useAsk, useTitle } from "../hooks";
import { TraceBuffer } from "../live/buffer";
import { Act, Empty, Facts, Loading, StatusChip, Trouble } from "../parts/bits";
import { EvidenceTable } from "../parts/evidence";
import type { Mark } from "../parts/line-chart";
import { ChartGroup, RigCharts } from "../parts/rig-charts";
import { at, Link } from "../router";
import { clock, codeMeaning, codeTitle, faultTitle, kindMeaning, seconds, sentence, STATUS_BITS } from "../words";

/** Seconds shown before the onset and after the confirmation. */
const BEFORE_S = 5;
const AFTER_S = 6;

export function FaultPage({ name, code }: { name: string; code: string }) {
  useTitle(`${codeTitle(code)} of ${name}`);
  const fault = useAsk(() => api.fault(name, code), `${name} ${code}`, 5000);
  const history = useAsk(() => api.history(name, code).then((page) => page.items), `${name} ${code} history`, 5000);
  const again = async () => void (await Promise.all([fault.again(), history.again()]));
  useEffect(() => events.listen((line) => {
    if (line.asset === name && line.code === code) void again();
  }), [name, code]);
  if (!fault.data) return <main>{fault.error ? <><h1>{codeTitle(code)}</h1><Trouble error={fault.error} again={() => void again()} /></> : <Loading what="the fault" />}</main>;
  return <Shown fault={fault.data} history={history.data ?? []} error={fault.error ?? history.error} again={again} />;
}

function Shown({ fault, history, error, again }: { fault: FaultEntry; history: History[]; error: unknown; again: () => Promise<void> }) {
  const { asset, code } = fault;
  const isOn = fault.status === "pending" || fault.status === "confirmed";
  const latest = history.find((entry) => entry.fault && (entry.what === "confirmed" || entry.what === "pending"));
  return (
    <main class="fault">
      <header class="page-head">
        <div>
          <p class="crumbs"><Link to="/">Fleet</Link> / <Link to={at("rigs", asset)}>{asset}</Link></p>
          <h1>{faultTitle(code, fault.kind)} <StatusChip {...fault} /></h1>
        </div>
        {isOn && <Acts fault={fault} again={again} />}
      </header>
      <Trouble error={error} />
      {latest?.fault && isOn
        ? <p class="sentence">{sentence(latest.fault.summary)}</p>
        : <Empty title={fault.status === "cleared" ? "Nothing is on record" : "On record, but not active"}>
            <p>{codeTitle(code)}: {codeMeaning(code)}. {fault.status === "healed" ? "Enough good sessions followed, so it has healed." : "Nothing of it has been found since it was last cleared."}</p>
          </Empty>}
      <div class="pair">
        <div class="column">
          <Causes fault={fault} />
          <Timeline history={history} fault={fault} />
        </div>
        <StatusByte byte={fault.status_byte} />
      </div>
      {latest && isOn && <Around key={latest.id} history={history} latest={latest} onset={fault.onset_s} />}
      {fault.freeze_frame && <section class="card"><h2>Freeze frame</h2><p class="quiet small-text">The numbers at the first failure of the current occurrence.</p><EvidenceTable of={fault.freeze_frame} /></section>}
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
      <label class="inline">as <input value={name} size={12} maxLength={60} onInput={(e) => setName(e.currentTarget.value)} aria-label="Your name, kept with what you do" /></label>
      <Act class="primary" disabled={fault.acknowledged} act={act(() => api.acknowledge(fault.asset, fault.code))}>{fault.acknowledged ? "Acknowledged" : "Acknowledge"}</Act>
      <Act act={act(() => api.clear(fault.asset, fault.code))}>Clear</Act>
    </div>
  );
}

function Causes({ fault }: { fault: FaultEntry }) {
  const candidates = fault.candidates.length ? fault.candidates : fault.status === "cleared" ? [] : [{ code: fault.code, kind: fault.kind, weight: 1 }];
  return (
    <section class="card">
      <h2>What it may be</h2>
      {candidates.length === 0 && <p class="quiet">Nothing is suspected.</p>}
      <ul class="candidates">
        {candidates.map((c) => (
          <li>
            <span><b>{faultTitle(c.code, c.kind)}</b><br /><span class="quiet">{c.kind ? kindMeaning(c.kind) : codeMeaning(c.code)}</span></span>
            <meter min={0} max={1} value={c.weight} aria-label={`Weight of ${faultTitle(c.code, c.kind)}`} />
            <span class="n">{Math.round(c.weight * 100)} %</span>
          </li>
        ))}
      </ul>
      <Facts of={[
        ["Since", fault.onset_s == null ? "the evidence does not say" : `${seconds(fault.onset_s)} on the device's clock`],
        ...(fault.axis ? [["Axis", `${fault.axis}, moved by ${fault.command}`] as [string, string]] : []),
        ["Occurrences", `${fault.occurrences} since the last clear`],
        ["Sessions with it", `${fault.trips}`],
        ["Good sessions since", `${fault.good_cycles}`],
        ["Last change", clock(fault.changed_at)],
      ]} />
    </section>
  );
}

function StatusByte({ byte }: { byte: string }) {
  const bits = Number.parseInt(byte, 16);
  return (
    <section class="card">
      <h2>Status byte <code>{byte}</code></h2>
      <table class="bits">
        <thead class="hidden"><tr><th>Bit</th><th>Value</th><th>Meaning</th></tr></thead>
        <tbody>
          {STATUS_BITS.map(({ bit, name, on, off }) => {
            const set = ((bits >> bit) & 1) === 1;
            return (
              <tr class={set ? "set" : ""}>
                <th scope="row">{bit}</th>
                <td class="bit">{set ? "1" : "0"}</td>
                <td><b>{name}</b><br />{set ? on : off}</td>
              </tr>
            );
          })}
        </tbody>
      </table>
      <p class="quiet small-text">ISO 14229-1, annex D.2. An operation cycle is a session.</p>
    </section>
  );
}

/** The seconds before and after, from the session's recording. */
function Around({ history, latest, onset }: { history: History[]; latest: History; onset?: number | null }) {
  const session = latest.session_id ?? "";
  const line = latest.fault!;
  const start = line.onset_s ?? onset ?? line.t_s;
  const [from, to] = [start - BEFORE_S, Math.max(line.t_s, start) + AFTER_S];
  const trace = useAsk(() => api.trace(session, { from_s: from, to_s: to }), `${session} ${from}`);
  const group = useMemo(() => new ChartGroup(), []);
  const buffer = useMemo(() => trace.data && TraceBuffer.of(trace.data), [trace.data]);
  useEffect(() => {
    if (!buffer?.t.length) return;
    const changes = history.filter((entry) => entry.session_id === session && entry.fault && entry.fault.t_s >= from && entry.fault.t_s <= to);
    const marks: Mark[] = changes.map(({ fault }) => ({ t: fault!.t_s, label: fault!.status, colour: fault!.status === "confirmed" ? "bad" : "warn" }));
    if (line.onset_s != null) marks.unshift({ t: line.onset_s, label: "onset", colour: "ink" });
    group.setMarks(marks);
    group.draw(buffer, [Math.max(from, buffer.first), Math.min(to, Math.max(buffer.last, from + 1))]);
  }, [buffer, history.length]);
  const axes = line.axis === "x" || line.axis === "y" ? [line.axis] as ("x" | "y")[] : (["x", "y"] as ("x" | "y")[]);
  return (
    <section class="card">
      <div class="card-head">
        <h2>Before and after</h2>
        <Link class="button" to={`${at("sessions", session)}?t=${start.toFixed(2)}`}>Play the session back</Link>
      </div>
      <Trouble error={trace.error} again={() => void trace.again()} />
      {trace.data && !buffer?.t.length && <p class="quiet">The recording has nothing from these seconds.</p>}
      <RigCharts group={group} kinds={["residual", "acceleration", "command", "position"]} axes={axes} height={150} />
    </section>
  );
}

const WHAT: Record<string, string> = {
  pending: "became pending", confirmed: "was confirmed", healed: "healed", cleared: "is off the record",
  acknowledge: "acknowledged", clear: "cleared",
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
            {entry.by
              ? <span><b>{entry.by}</b> {WHAT[entry.what]} it</span>
              : <span>{faultTitle(fault.code, entry.fault?.kind)} <b>{WHAT[entry.what] ?? entry.what}</b>{entry.fault && <> at {seconds(entry.fault.t_s)} of {entry.session_id ? <Link to={`${at("sessions", entry.session_id)}?t=${(entry.fault.onset_s ?? entry.fault.t_s).toFixed(2)}`}>{entry.fault.session}</Link> : entry.fault.session}</>}</span>}
          </li>
        ))}
      </ol>
    </section>
  );
}
