import { useMemo } from "preact/hooks";
import { navigate, useLocation } from "../../router/navigation";
import { sessionQuery, type SessionKey } from "./session-filter";

/** The filter in the address, and its change. */
export function useSessionFilter() {
  const { query } = useLocation();
  const text = query.toString();
  const filter = useMemo(() => sessionQuery(new URLSearchParams(text)), [text]);
  const word = (key: SessionKey) => query.get(key) ?? "";
  const change = (key: SessionKey, value: string) => {
    const next = new URLSearchParams(text);
    if (value) next.set(key, value);
    else next.delete(key);
    navigate(`/sessions${next.size ? `?${next}` : ""}`, true);
  };
  return { filter, word, change };
}
