import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { api } from "../../api/client";
import { faultEvents, type FaultEvent } from "../../api/events";
import type { FleetEntry } from "../../api/types";
import { useLatest } from "../../hooks/use-latest";
import { useQuery } from "../../hooks/use-query";
import { afterEvent, withLine } from "./fleet-state";

/** Time between two looks at the whole fleet: longer for a larger one, ms. */
const intervalFor = (n: number) => 2000 + 2 * n;

/** Entries that events have changed since the answer of the service that they belong to. */
interface Patches {
  answer?: FleetEntry[];
  entries: Map<string, FleetEntry>;
}

/** The fleet as it is now: fetched in a rhythm, and changed at once by every event. */
export function useFleet() {
  const [interval, setPollInterval] = useState(intervalFor(0));
  const { data: answer, error, refetch } = useQuery(api.fleet, "fleet", interval);
  const [patches, setPatches] = useState<Patches>({ entries: new Map() });
  const [lines, setLines] = useState<FaultEvent[]>([]);
  const current = useRef(new Map<string, FleetEntry>());

  const n = answer?.length;
  useEffect(() => {
    if (n !== undefined) setPollInterval(intervalFor(n));
  }, [n]);

  const fleet = useMemo(() => {
    const patched = patches.answer === answer ? patches.entries : new Map<string, FleetEntry>();
    const entries = answer?.map((entry) => patched.get(entry.asset) ?? entry);
    current.current = new Map(entries?.map((entry) => [entry.asset, entry]));
    return entries;
  }, [answer, patches]);

  const latestAnswer = useLatest(answer);
  useEffect(() => {
    const patch = (entry: FleetEntry) => {
      current.current.set(entry.asset, entry);
      setPatches((before) => {
        const known = before.answer === latestAnswer.current ? before.entries : [];
        return { answer: latestAnswer.current, entries: new Map(known).set(entry.asset, entry) };
      });
    };
    return faultEvents.listen((line) => {
      setLines((before) => withLine(before, line));
      const entry = current.current.get(line.asset ?? "");
      if (entry) patch(afterEvent(entry, line));
      else void refetch();
    });
  }, [refetch, latestAnswer]);

  // What happened while the connection was lost is in the next answer.
  useEffect(() => {
    let before = faultEvents.state;
    return faultEvents.watch((state) => {
      if (state === "live" && before === "lost") void refetch();
      before = state;
    });
  }, [refetch]);
  return { fleet, error, refetch, lines };
}
