import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { useLatest } from "./use-latest";

export interface Query<T> {
  data?: T;
  error?: unknown;
  refetch: () => Promise<void>;
}

/**
 * Fetches when `key` changes, and again `interval` ms after each response if given. Keeps the last
 * data while fetching fails; ignores the response of a fetch if a later one has started.
 */
export function useQuery<T>(fetch: () => Promise<T>, key: unknown, interval?: number): Query<T> {
  const [response, setResponse] = useState<{ key: unknown; data?: T; error?: unknown }>({ key });
  const latestFetch = useLatest(fetch);
  /** Number of the latest fetch; responses of earlier ones are ignored. */
  const newest = useRef(0);
  const ignorePending = useCallback(() => void newest.current++, []);
  const refetch = useCallback(async () => {
    const turn = ++newest.current;
    try {
      const data = await latestFetch.current();
      if (turn === newest.current) setResponse({ key, data });
    } catch (error) {
      if (turn !== newest.current) return;
      setResponse((before) => ({ key, data: before.key === key ? before.data : undefined, error }));
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
      ignorePending();
      clearTimeout(timer);
    };
  }, [refetch, ignorePending, interval]);
  const { data, error } = response.key === key ? response : {};
  return { data, error, refetch };
}
