/** What the fleet's answers and events say of each rig. */
import type { FaultEvent } from "../../api/events";
import type { FaultLine, FleetEntry } from "../../api/types";
import { healthByFaults, type RigHealth } from "../../words/severity";

/** A rig with an open session that has sent nothing for so long is silent, ms. */
const SILENT_MS = 10_000;

/** Event lines that the page keeps. */
const MOST_LINES = 50;

export function healthOf(entry: FleetEntry, now: number): RigHealth {
  const byFaults = healthByFaults(entry.faults);
  if (byFaults) return byFaults;
  if (entry.warnings.length) return "drift";
  if (!entry.session_id) return "idle";
  return entry.last_seen && now - Date.parse(entry.last_seen) < SILENT_MS ? "ok" : "silent";
}

/** An entry as it is after an event. */
export function afterEvent(entry: FleetEntry, line: FaultLine, now = new Date()): FleetEntry {
  const others = entry.faults.filter((fault) => fault.code !== line.code);
  const isActive = line.status === "pending" || line.status === "confirmed";
  if (!isActive) return { ...entry, faults: others };
  const known = entry.faults.find((fault) => fault.code === line.code);
  const fault = {
    code: line.code,
    kind: line.kind,
    status: line.status,
    acknowledged: known?.acknowledged ?? false,
    changed_at: now.toISOString(),
  };
  return { ...entry, faults: [...others, fault] };
}

/** Whether an event tells of the same change once more, as when its kind shows later. */
const isSameChange = (a: FaultLine, b: FaultLine) =>
  (["asset", "session", "code", "status", "onset_s"] as const).every((key) => a[key] === b[key]);

/** The event lines with a new one on top, in the place of those that told of the same change. */
export const withLine = (lines: FaultEvent[], line: FaultEvent): FaultEvent[] =>
  [line, ...lines.filter((known) => !isSameChange(known, line))].slice(0, MOST_LINES);
