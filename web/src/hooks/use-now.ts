import { useEffect, useState } from "preact/hooks";

/** The time, anew every `interval` ms, so that "3 s ago" stays true. */
export function useNow(interval = 1000): number {
  const [now, setNow] = useState(Date.now());
  useEffect(() => {
    const timer = setInterval(() => setNow(Date.now()), interval);
    return () => clearInterval(timer);
  }, [interval]);
  return now;
}
