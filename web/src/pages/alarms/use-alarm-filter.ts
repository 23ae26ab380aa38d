import { useMemo } from "preact/hooks";
import { navigate, useLocation } from "../../router/navigation";
import { alarmFilter, type AlarmKey } from "./alarm-filter";

/** The filter, order and grouping in the address, and their change. */
export function useAlarmFilter() {
  const { query } = useLocation();
  const text = query.toString();
  // The same filter as long as the address is the same, so that the start of its time range stays.
  const filter = useMemo(() => alarmFilter(new URLSearchParams(text), Date.now()), [text]);
  const change = (key: AlarmKey, value: string) => {
    const next = new URLSearchParams(text);
    if (value) next.set(key, value);
    else next.delete(key);
    navigate(`/alarms${next.size ? `?${next}` : ""}`, true);
  };
  const word = (key: AlarmKey) => query.get(key) ?? "";
  return { filter, word, change };
}
