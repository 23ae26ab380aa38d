import { alarmApi, type Alarm, type AlarmFilter } from "../../api/alarms";
import { useFleetChanges } from "../../hooks/use-fleet-changes";
import { useQuery } from "../../hooks/use-query";

/** Polling interval, ms; events report changes earlier. */
const INTERVAL_MS = 15_000;

/** Names an alarm among those of the fleet. */
export const alarmKey = ({ asset, code }: Pick<Alarm, "asset" | "code">) => `${asset} ${code}`;

/** All alarms that `filter` selects. */
export function useAlarms(filter: AlarmFilter) {
  const { data, error, refetch } = useQuery(
    () => alarmApi.allAlarms(filter),
    JSON.stringify(filter),
    INTERVAL_MS,
  );
  useFleetChanges(refetch);
  return { alarms: data, error, refetch };
}
