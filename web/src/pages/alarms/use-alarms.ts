import { useState } from "preact/hooks";
import { alarmApi, type Alarm, type AlarmFilter } from "../../api/alarms";
import { useQuery } from "../../hooks/use-query";

const INTERVAL_MS = 5000;

/** Names an alarm among those of the fleet. */
export const alarmKey = ({ asset, code }: Pick<Alarm, "asset" | "code">) => `${asset} ${code}`;

/** Alarms after the first page, for one filter. */
interface FurtherPages {
  filter: AlarmFilter;
  items: Alarm[];
  next?: string | null;
}

/** The alarms that `filter` selects: the first page is polled, `loadMore` fetches the next one. */
export function useAlarms(filter: AlarmFilter) {
  const {
    data: first,
    error,
    refetch,
  } = useQuery(() => alarmApi.alarms(filter), JSON.stringify(filter), INTERVAL_MS);
  const [loaded, setLoaded] = useState<FurtherPages>();
  const rest = loaded?.filter === filter ? loaded : undefined;
  // Alarms that change move to the first page.
  const known = new Set(first?.items.map(alarmKey));
  const others = (rest?.items ?? []).filter((alarm) => !known.has(alarmKey(alarm)));
  const next = rest ? rest.next : first?.next;
  const loadMore = async () => {
    const page = await alarmApi.alarms(filter, next);
    setLoaded({ filter, items: [...(rest?.items ?? []), ...page.items], next: page.next });
  };
  return {
    alarms: first && [...first.items, ...others],
    error,
    refetch,
    loadMore: next ? loadMore : undefined,
  };
}
