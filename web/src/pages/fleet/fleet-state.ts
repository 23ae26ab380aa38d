/** The state of each rig by its fleet entry and events. */
import { isCommunication, type FleetEvent } from "../../api/events";
import type { CommunicationLine, FaultLine, FleetEntry } from "../../api/types";
import { healthByFaults, type RigHealth } from "../../words/severity";
import { isFailing, isTested } from "../../words/status-byte";

/** An event, and when it arrived at the page. */
export type ReceivedEvent = FleetEvent & { received: Date };

/** Number of event lines that the page keeps. */
const MAX_LINES = 50;

export function healthOf(entry: FleetEntry): RigHealth {
  const isMuted = (code: string) => entry.muted?.some((mute) => mute.code === code);
  const byFaults = healthByFaults(entry.faults.filter((fault) => !isMuted(fault.code)));
  if (byFaults) return byFaults;
  if (entry.warnings.length) return "drift";
  if (!entry.session_id) return "idle";
  // The service judges it: between two looks at a large fleet, every rig would seem silent here.
  if (entry.silent) return "silent";
  if (entry.unjudged || entry.muted?.some(({ code }) => code !== "communication_lost")) return "untested";
  return entry.calibrated ? "ok" : "unlearnt";
}

/** Returns the entry after data stay away, or are back. */
function afterCommunication(entry: FleetEntry, { status, since }: CommunicationLine): FleetEntry {
  const isLost = status === "confirmed";
  return { ...entry, silent: isLost, communication_lost_since: isLost ? since : null };
}

/** Returns the entry after an event. */
export function afterEvent(
  entry: FleetEntry,
  line: FaultLine | CommunicationLine,
  now = new Date(),
): FleetEntry {
  if (isCommunication(line)) return afterCommunication(entry, line);
  const others = entry.faults.filter((fault) => fault.code !== line.code);
  const isActive = line.status === "pending" || line.status === "confirmed";
  if (!isActive) return { ...entry, faults: others };
  const known = entry.faults.find((fault) => fault.code === line.code);
  const failing = isFailing(line);
  const hasBegun = failing && !known?.failing;
  const fault = {
    code: line.code,
    kind: line.kind,
    status: line.status,
    failing,
    tested: isTested(line),
    failed_at: hasBegun ? now.toISOString() : known?.failed_at,
    acknowledged: !hasBegun && (known?.acknowledged ?? false),
    changed_at: now.toISOString(),
  };
  return { ...entry, faults: [...others, fault] };
}

/** What two events about the same change have in common, as when the kind is determined later. */
function changeKey(line: FleetEvent): string {
  const { asset, session, code, status } = line;
  const more = isCommunication(line) ? [line.since] : [line.status_byte, line.onset_s];
  return JSON.stringify([asset, session, code, status, ...more]);
}

/** Returns the event lines with a new one first; it replaces lines about the same change. */
export const withLine = (lines: ReceivedEvent[], line: ReceivedEvent): ReceivedEvent[] =>
  [line, ...lines.filter((known) => changeKey(known) !== changeKey(line))].slice(0, MAX_LINES);
