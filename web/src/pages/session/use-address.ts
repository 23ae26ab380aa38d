import { useEffect, useMemo, useRef } from "preact/hooks";
import { readAddress, withAddress, type SessionAddress } from "./address";

/** Delay before a change is written, ms: a slider that is moved would write a hundred times per second. */
const DELAY_MS = 300;

/** The moment, speed and profile in the address of the page, so that a link leads to what is shown. */
export function useAddress() {
  const address = useMemo(() => readAddress(location.search), []);
  const pending = useRef<Partial<SessionAddress>>({});
  const timer = useRef<ReturnType<typeof setTimeout>>(undefined);
  useEffect(() => () => clearTimeout(timer.current), []);
  const write = (part: Partial<SessionAddress>) => {
    pending.current = { ...pending.current, ...part };
    clearTimeout(timer.current);
    timer.current = setTimeout(() => {
      const search = withAddress(location.search, pending.current);
      history.replaceState(null, "", location.pathname + search);
      pending.current = {};
    }, DELAY_MS);
  };
  return { address, write };
}
