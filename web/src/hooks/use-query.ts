import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { useLatest } from "./use-latest";

export interface Query<T> {
  data?: T;
  error?: unknown;
  refetch: () => Promise<void>;
}

/**
 * Fetches once for each `key`, and every `interval` ms after the last answer if given. Keeps the
 * last answer while fetching fails; an answer that a later fetch has overtaken counts for nothing.
 */
export function useQuery<T>(fetch: () => Promise<T>, key: unknown, interval?: number): Query<T> {
  const [answer, setAnswer] = useState<{ key: unknown; data?: T; error?: unknown }>({ key });
  const latestFetch = useLatest(fetch);
  /** Counts fetches, so that an answer knows whether it is of the newest. */
  const newest = useRef(0);
  const forgetAnswers = useCallback(() => void newest.current++, []);
  const refetch = useCallback(async () => {
    const turn = ++newest.current;
    try {
      const data = await latestFetch.current();
      if (turn === newest.current) setAnswer({ key, data });
    } catch (error) {
      if (turn !== newest.current) return;
      setAnswer((before) => ({ key, data: before.key === key ? before.data : undefined, error }));
    }
  }, [key, latestFetch]);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    let stopped = false;
    const loop = async () => {
      await refetch();
      if (interval && !stopped) timer = setTimeout(() => void loop(), interval);
    };
    void loop();
    return () => {
      stopped = true;
      forgetAnswers();
      clearTimeout(timer);
    };
  }, [refetch, forgetAnswers, interval]);
  const { data, error } = answer.key === key ? answer : {};
  return { data, error, refetch };
}
