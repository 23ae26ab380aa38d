import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { api } from "../../api/client";
import { fleetEvents } from "../../api/events";
import type { FleetEntry } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import { useQuery } from "../../hooks/use-query";
import { afterEvent, withLine, type ReceivedEvent } from "./fleet-state";

/** Polling interval for a fleet of `n` rigs, ms. */
const intervalFor = (n: number) => 2000 + 2 * n;

/** Entries that events have changed since the last response of the service. */
interface Patches {
  base?: FleetEntry[];
  entries: Map<string, FleetEntry>;
}

/** The current fleet: polled, and updated immediately by every event. */
export function useFleet() {
  const [interval, setPollInterval] = useState(intervalFor(0));
  const { data: polled, error, refetch } = useQuery(api.fleet, "fleet", interval);
  const [patches, setPatches] = useState<Patches>({ entries: new Map() });
  const [lines, setLines] = useState<ReceivedEvent[]>([]);
  const current = useRef(new Map<string, FleetEntry>());

  const n = polled?.length;
  useEffect(() => {
    if (n !== undefined) setPollInterval(intervalFor(n));
  }, [n]);

  const fleet = useMemo(() => {
    const patched = patches.base === polled ? patches.entries : new Map<string, FleetEntry>();
    const entries = polled?.map((entry) => patched.get(entry.asset) ?? entry);
    current.current = new Map(entries?.map((entry) => [entry.asset, entry]));
    return entries;
  }, [polled, patches]);

  const latestPolled = useLatest(polled);
  useEffect(() => {
    const patch = (entry: FleetEntry) => {
      current.current.set(entry.asset, entry);
      setPatches((before) => {
        const known = before.base === latestPolled.current ? before.entries : [];
        return { base: latestPolled.current, entries: new Map(known).set(entry.asset, entry) };
      });
    };
    return fleetEvents.listen((line) => {
      setLines((before) => withLine(before, { ...line, received: new Date() }));
      const entry = current.current.get(line.asset ?? "");
      if (entry) patch(afterEvent(entry, line));
      else void refetch();
    });
  }, [refetch, latestPolled]);

  /** The time of the last look at the fleet: "last seen" is told as of then, ms since 1970. */
  const seenAt = useMemo(() => (polled ? Date.now() : 0), [polled]);

  // After a lost connection, the missed changes are fetched.
  useEffect(() => {
    let before = fleetEvents.state;
    return fleetEvents.watch((state) => {
      if (state === "live" && before === "lost") void refetch();
      before = state;
    });
  }, [refetch]);
  return { fleet, seenAt, error, refetch, lines };
}
