import { useEffect, useRef, useState } from "preact/hooks";
import { useLatest } from "./use-latest";

/** Time for which an action can be taken back, ms. */
export const UNDO_MS = 8000;

/**
 * Carries out an action a while after it was asked for, so that it can be taken back; at once if the page is left
 * meanwhile.
 */
export function useDelayed(action: () => Promise<unknown>) {
  const latest = useLatest(action);
  const waiting = useRef<{ timer: ReturnType<typeof setTimeout>; run: () => void } | undefined>(undefined);
  const [isWaiting, setWaiting] = useState(false);
  const [error, setError] = useState<unknown>();
  const isMounted = useRef(true);
  useEffect(() => {
    const leave = () => waiting.current?.run();
    window.addEventListener("pagehide", leave);
    return () => {
      isMounted.current = false;
      window.removeEventListener("pagehide", leave);
      leave();
    };
  }, []);
  const stop = () => {
    clearTimeout(waiting.current?.timer);
    waiting.current = undefined;
  };
  const start = () => {
    const chosen = latest.current;
    const run = () => {
      stop();
      chosen()
        .catch((thrown: unknown) => isMounted.current && setError(thrown))
        .finally(() => isMounted.current && setWaiting(false));
    };
    setError(undefined);
    setWaiting(true);
    waiting.current = { timer: setTimeout(run, UNDO_MS), run };
  };
  const undo = () => {
    stop();
    setWaiting(false);
  };
  return { isWaiting, error, start, undo };
}

export type Delayed = ReturnType<typeof useDelayed>;
