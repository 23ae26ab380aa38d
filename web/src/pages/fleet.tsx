/** All rigs: which is sick, which is silent, which lags. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { FleetEntry } from "../api/types";
import { useNow, useTitle } from "../hooks";
import { healthOf, useFleet } from "../live/fleet";
import { Empty, FaultChip, HealthMark, Loading, Trouble, type Health } from "../parts/bits";
import { DriftChips } from "../parts/trends";
import { VirtualList } from "../parts/virtual-list";
import { at, go, Link, usePlace } from "../router";
import { ago, codeTitle, count, number, sentence, severity } from "../words";

type Filter = Health | "all";

const FILTERS: { key: Filter; word: string }[] = [
  { key: "all", word: "All" },
  { key: "fault", word: "Fault" },
  { key: "suspect", word: "Suspected" },
  { key: "drift", word: "Drifting" },
  { key: "ok", word: "No fault" },
  { key: "silent", word: "Silent" },
  { key: "idle", word: "No session" },
];

const SORTS = {
  severity: "worst first",
  name: "by name",
  seen: "last heard first",
  lag: "greatest lag first",
} as const;

/** Later than this is worth a colour, s. */
const LAG_S = 2;

/** bench-2 comes before bench-10. */
const NAMES = new Intl.Collator("en", { numeric: true });

type Row = { entry: FleetEntry; health: Health; worst: number; place: number };

function matches(entry: FleetEntry, text: string): boolean {
  const haystack = [
    entry.asset,
    entry.session ?? "",
    ...entry.faults.flatMap((f) => [f.code, codeTitle(f.code), f.kind ?? ""]),
    ...entry.warnings.flatMap((w) => [w.code, codeTitle(w.code), w.parameter]),
  ]
    .join(" ")
    .toLowerCase();
  return text
    .toLowerCase()
    .split(/\s+/)
    .every((word) => haystack.includes(word));
}

/** Assets as a person orders them; comparing thousands of names takes too long for every second. */
function useNameOrder(fleet: FleetEntry[] = []): Map<string, number> {
  const names = fleet.map((entry) => entry.asset);
  const key = useRef<string[]>([]);
  if (names.length !== key.current.length || names.some((name, i) => name !== key.current[i]))
    key.current = names;
  return useMemo(
    () => new Map([...key.current].sort(NAMES.compare).map((name, i) => [name, i])),
    [key.current],
  );
}

function order(sort: keyof typeof SORTS): (a: Row, b: Row) => number {
  const name = (a: Row, b: Row) => a.place - b.place;
  const rank: Record<Health, number> = { fault: 0, suspect: 1, drift: 2, silent: 3, ok: 4, idle: 5 };
  const by: Record<keyof typeof SORTS, (a: Row, b: Row) => number> = {
    severity: (a, b) => b.worst - a.worst || rank[a.health] - rank[b.health],
    name: () => 0,
    seen: (a, b) => (b.entry.last_seen ?? "").localeCompare(a.entry.last_seen ?? ""),
    lag: (a, b) => (b.entry.lag_s ?? -1) - (a.entry.lag_s ?? -1),
  };
  return (a, b) => by[sort](a, b) || name(a, b);
}

/** Rows are as high as this; on a phone, two lines more. */
const useRowHeight = () => {
  const [height, set] = useState(innerWidth < 700 ? 104 : 56);
  useEffect(() => {
    const measure = () => set(innerWidth < 700 ? 104 : 56);
    addEventListener("resize", measure);
    return () => removeEventListener("resize", measure);
  }, []);
  return height;
};

export function FleetPage() {
  useTitle("Fleet");
  const { fleet, error, again, lines } = useFleet();
  const { query } = usePlace();
  const now = useNow();
  const height = useRowHeight();
  const text = query.get("search") ?? "";
  const filter = (query.get("health") || "all") as Filter;
  const sort = (query.get("sort") ?? "severity") as keyof typeof SORTS;
  const change = (key: string, value: string) => {
    const next = new URLSearchParams(query);
    if (value) next.set(key, value);
    else next.delete(key);
    go(`/${next.size ? `?${next}` : ""}`, true);
  };
  const places = useNameOrder(fleet);
  const rows = useMemo<Row[]>(
    () =>
      (fleet ?? []).map((entry) => ({
        entry,
        health: healthOf(entry, now),
        worst: Math.max(0, ...entry.faults.map(severity)),
        place: places.get(entry.asset) ?? 0,
      })),
    [fleet, now],
  );
  const shown = useMemo(
    () =>
      rows
        .filter((row) => (filter === "all" || row.health === filter) && (!text || matches(row.entry, text)))
        .sort(order(sort in SORTS ? sort : "severity")),
    [rows, filter, text, sort],
  );
  const n = (health: Filter) =>
    health === "all" ? rows.length : rows.filter((row) => row.health === health).length;

  if (!fleet)
    return (
      <main>
        {error ? (
          <>
            <h1>Fleet</h1>
            <Trouble error={error} again={() => void again()} />
          </>
        ) : (
          <Loading what="the fleet" />
        )}
      </main>
    );
  if (!fleet.length) {
    return (
      <main>
        <h1>Fleet</h1>
        <Trouble error={error} />
        <Empty title="No rig yet">
          <p>Describe your rig, send its telemetry, and see it here: it takes about five minutes.</p>
          <p>
            <Link to="/set-up" class="button primary">
              Set up a rig
            </Link>{" "}
            <span class="quiet">
              or run <code>offbd demo</code> for a simulated one.
            </span>
          </p>
        </Empty>
      </main>
    );
  }
  return (
    <main class="fleet">
      <h1>Fleet</h1>
      <Trouble error={error} />
      <div class="tools">
        <div class="chips" role="group" aria-label="Show">
          {FILTERS.map(({ key, word }) => (
            <button
              type="button"
              class={`filter filter-${key}`}
              aria-pressed={filter === key}
              onClick={() => change("health", key === "all" ? "" : key)}
            >
              {word} <b>{count(n(key))}</b>
            </button>
          ))}
        </div>
        <input
          type="search"
          aria-label="Search rigs, faults, sessions"
          placeholder="Search rigs, faults, sessions"
          value={text}
          onInput={(e) => change("search", e.currentTarget.value)}
        />
        <label class="inline">
          Sort{" "}
          <select value={sort} onChange={(e) => change("sort", e.currentTarget.value)}>
            {Object.entries(SORTS).map(([key, word]) => (
              <option value={key}>{word}</option>
            ))}
          </select>
        </label>
      </div>
      <div class="fleet-columns">
        <section aria-label="Rigs">
          <div class="fleet-row fleet-head" aria-hidden="true">
            <span>Rig</span>
            <span>State</span>
            <span>Faults</span>
            <span>Session</span>
            <span class="n">Lag</span>
            <span class="n">Last heard</span>
          </div>
          {shown.length ? (
            <VirtualList
              items={shown}
              rowHeight={height}
              label="Rigs"
              id={(row) => row.entry.asset}
              row={(row) => <FleetRow row={row} now={now} />}
            />
          ) : (
            <p class="quiet">
              No rig matches.{" "}
              <button type="button" class="link" onClick={() => go("/", true)}>
                Show all {count(rows.length)}
              </button>
            </p>
          )}
        </section>
        <section class={`feed${lines.length ? "" : " none"}`} aria-label="Events">
          <h2>Events</h2>
          {lines.length === 0 && (
            <p class="quiet">
              None since this page was opened. Changes of any fault appear here as they happen.
            </p>
          )}
          <ol aria-live="polite">
            {lines.slice(0, 20).map((line) => (
              <li key={line.event}>
                <Link to={at("rigs", line.asset ?? "", "faults", line.code)}>
                  <b>{line.asset}</b> <span class={`status-${line.status}`}>{line.status}</span>
                </Link>
                <p>{sentence(line.summary)}</p>
              </li>
            ))}
          </ol>
        </section>
      </div>
    </main>
  );
}

/** What is said of a rig that is not learnt. */
const UNLEARNT: Record<FleetEntry["learning"], { word: string; meaning: string }> = {
  gathering: {
    word: "not learnt",
    meaning:
      "It learns by itself as soon as enough motion has come; until then only faults of the sensor are confirmed",
  },
  learning: { word: "being learnt", meaning: "Enough motion has come" },
  offered: {
    word: "was it healthy?",
    meaning: "What was learnt waits for somebody to say that the rig was healthy",
  },
  learnt: { word: "", meaning: "" },
};

function FleetRow({ row: { entry, health }, now }: { row: Row; now: number }) {
  const faults = [...entry.faults].sort((a, b) => severity(b) - severity(a));
  return (
    <Link to={at("rigs", entry.asset)} class={`fleet-row row-${health}`}>
      <span class="name">
        {entry.asset}
        {!entry.calibrated && (
          <span class="quiet small-text" title={UNLEARNT[entry.learning].meaning}>
            {" "}
            {UNLEARNT[entry.learning].word}
          </span>
        )}
      </span>
      <HealthMark health={health} />
      <span class="faults">
        {faults.map((fault) => (
          <FaultChip {...fault} />
        ))}
        <DriftChips warnings={entry.warnings} />
        {!faults.length && !entry.warnings.length && <span class="quiet">none</span>}
      </span>
      <span class="quiet clip">{entry.session ?? "–"}</span>
      <span class={`n${(entry.lag_s ?? 0) > LAG_S ? " late" : ""}`}>
        <span class="only-small">lag </span>
        {number(entry.lag_s, 1, "s")}
      </span>
      <span class="n quiet">{ago(entry.last_seen, now)}</span>
    </Link>
  );
}
