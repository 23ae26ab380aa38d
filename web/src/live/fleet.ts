/** The fleet as it is now: asked for in a rhythm, and changed at once by every event. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { api } from "../api/client";
import { events } from "../api/events";
import type { FaultLine, FleetEntry } from "../api/types";
import { useAsk } from "../hooks";
import type { Health } from "../parts/bits";
import { severity } from "../words";

/** A rig with an open session that has sent nothing for so long is silent, ms. */
const SILENT_MS = 10_000;

/** Event lines that the page keeps. */
const MOST_LINES = 50;

/** Time between two looks at the whole fleet: longer for a larger one, ms. */
const rhythm = (n: number) => 2000 + 2 * n;

export function healthOf(entry: FleetEntry, now: number): Health {
  const worst = Math.max(0, ...entry.faults.map(severity));
  if (worst >= 2) return "fault";
  if (worst === 1) return "suspect";
  if (entry.warnings.length) return "drift";
  if (!entry.session_id) return "idle";
  return entry.last_seen && now - Date.parse(entry.last_seen) < SILENT_MS ? "ok" : "silent";
}

/** What an event changes in an entry. */
function changed(entry: FleetEntry, line: FaultLine): FleetEntry {
  const others = entry.faults.filter((fault) => fault.code !== line.code);
  const active = line.status === "pending" || line.status === "confirmed";
  const known = entry.faults.find((fault) => fault.code === line.code);
  const fault = {
    code: line.code,
    kind: line.kind,
    status: line.status,
    acknowledged: known?.acknowledged ?? false,
    changed_at: new Date().toISOString(),
  };
  return { ...entry, faults: active ? [...others, fault] : others };
}

/** Whether an event tells of the same change again, as when its kind shows later. */
function retold(known: FaultLine, line: FaultLine): boolean {
  return (
    known.asset === line.asset &&
    known.session === line.session &&
    known.code === line.code &&
    known.status === line.status &&
    known.onset_s === line.onset_s
  );
}

export function useFleet() {
  const [every, setEvery] = useState(rhythm(0));
  const asked = useAsk(api.fleet, "fleet", every);
  const [patches, setPatches] = useState<{ of: unknown; by: Map<string, FleetEntry> }>({
    of: undefined,
    by: new Map(),
  });
  const [lines, setLines] = useState<(FaultLine & { event: number })[]>([]);
  const current = useRef<Map<string, FleetEntry>>(new Map());

  useEffect(() => {
    if (asked.data) setEvery(rhythm(asked.data.length));
  }, [asked.data?.length]);

  const fleet = useMemo(() => {
    const by = patches.of === asked.data ? patches.by : new Map<string, FleetEntry>();
    const items = asked.data?.map((entry) => by.get(entry.asset) ?? entry);
    current.current = new Map(items?.map((entry) => [entry.asset, entry]));
    return items;
  }, [asked.data, patches]);

  const latest = useRef(asked.data);
  latest.current = asked.data;
  useEffect(
    () =>
      events.listen((line) => {
        setLines((before) => [line, ...before.filter((known) => !retold(known, line))].slice(0, MOST_LINES));
        const entry = current.current.get(line.asset ?? "");
        if (!entry) return void asked.again();
        const after = changed(entry, line);
        current.current.set(entry.asset, after);
        setPatches((before) => ({
          of: latest.current,
          by: new Map(before.of === latest.current ? before.by : []).set(entry.asset, after),
        }));
      }),
    [],
  );

  // What happened while the connection was lost is in the next look.
  useEffect(() => {
    let was = events.link;
    return events.watch((link) => {
      if (link === "live" && was === "lost") void asked.again();
      was = link;
    });
  }, []);
  return { fleet, error: asked.error, again: asked.again, lines };
}
