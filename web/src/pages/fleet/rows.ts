/** The rows of the list of rigs: filter, search and order. */
import type { FleetEntry } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import type { Presence } from "../../words/fault-state";
import { worstSeverity, type RigHealth } from "../../words/severity";
import { healthOf } from "./fleet-state";

export interface FleetRow {
  entry: FleetEntry;
  health: RigHealth;
  worst: number;
  /** Rank among all rigs by name. */
  nameRank: number;
}

export type HealthFilter = RigHealth | "all";

export const SORTS = {
  severity: "worst first",
  newest: "newest fault first",
  name: "by name",
  seen: "last seen first",
  lag: "greatest lag first",
} as const;

export type Sort = keyof typeof SORTS;

/** Sorts bench-2 before bench-10. */
const NAMES = new Intl.Collator("en", { numeric: true });

/** The rank of each name in natural order. */
export const nameRanks = (names: string[]) =>
  new Map([...names].sort((a, b) => NAMES.compare(a, b)).map((name, rank) => [name, rank]));

export const rowOf = (entry: FleetEntry, ranks: Map<string, number>): FleetRow => ({
  entry,
  health: healthOf(entry),
  worst: worstSeverity(entry.faults),
  nameRank: ranks.get(entry.asset) ?? 0,
});

/** Whether the entry contains every word of `text`. */
function matches({ asset, tags, session, faults, warnings }: FleetEntry, text: string): boolean {
  const words = [
    asset,
    ...tags,
    session ?? "",
    ...faults.flatMap(({ code, kind }) => [code, codeTitle(code), kind ?? ""]),
    ...warnings.flatMap(({ code, parameter }) => [code, codeTitle(code), parameter]),
  ];
  const haystack = words.join(" ").toLowerCase();
  return text
    .toLowerCase()
    .split(/\s+/)
    .every((word) => haystack.includes(word));
}

/** Order of rigs of equal severity. */
const HEALTH_RANK: Record<RigHealth, number> = {
  fault: 0,
  suspect: 1,
  recorded: 2,
  drift: 3,
  untested: 4,
  silent: 5,
  unlearnt: 6,
  ok: 7,
  unknown: 8,
  idle: 9,
};

/** The time at which a test of the rig last began to fail; empty without a fault. */
const lastFailure = ({ faults }: FleetEntry) =>
  faults.reduce((last, { failed_at }) => (failed_at && failed_at > last ? failed_at : last), "");

const COMPARE: Record<Sort, (a: FleetRow, b: FleetRow) => number> = {
  severity: (a, b) => b.worst - a.worst || HEALTH_RANK[a.health] - HEALTH_RANK[b.health],
  newest: (a, b) => lastFailure(b.entry).localeCompare(lastFailure(a.entry)),
  name: () => 0,
  seen: (a, b) => (b.entry.last_seen ?? "").localeCompare(a.entry.last_seen ?? ""),
  lag: (a, b) => (b.entry.lag_s ?? -1) - (a.entry.lag_s ?? -1),
};

/** Whether no data arrive from a rig whose session is open. */
export const isSilent = ({ entry }: Pick<FleetRow, "entry">) =>
  Boolean(entry.session_id && (entry.silent || entry.communication_lost_since));

/** Whether data of a rig arrive. */
export const presenceOfRow = (row: Pick<FleetRow, "entry">): Presence =>
  row.entry.session_id == null ? "ended" : isSilent(row) ? "silent" : "arriving";

/** A rig that fell silent while it failed is one of both. */
const belongs = (row: FleetRow, filter: HealthFilter) =>
  filter === "all" || row.health === filter || (filter === "silent" && isSilent(row));

/** Returns the rows that match the filter and the search, in order. */
export function chosenRows(rows: FleetRow[], filter: HealthFilter, text: string, sort: string): FleetRow[] {
  const compare = COMPARE[sort in SORTS ? (sort as Sort) : "severity"];
  return rows
    .filter((row) => belongs(row, filter) && (!text || matches(row.entry, text)))
    .sort((a, b) => compare(a, b) || a.nameRank - b.nameRank);
}

export const countRows = (rows: FleetRow[], filter: HealthFilter) =>
  rows.filter((row) => belongs(row, filter)).length;
