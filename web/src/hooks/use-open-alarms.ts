import { alarmApi } from "../api/alarms";
import { useFleetChanges } from "./use-fleet-changes";
import { useQuery } from "./use-query";

/** Polling interval, ms; events report changes earlier. */
const INTERVAL_MS = 5000;

/** The number of confirmed alarms that fail and are unacknowledged, as text; undefined if there is none. */
export function useOpenAlarms(): string | undefined {
  const fetch = () => alarmApi.alarms({ state: "failing", acknowledged: false });
  const { data, refetch } = useQuery(fetch, "open alarms", INTERVAL_MS);
  useFleetChanges(refetch);
  const n = data?.items.filter(({ muted }) => !muted).length ?? 0;
  return n ? `${n}${data?.next ? "+" : ""}` : undefined;
}
