import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { isUnreachable } from "../api/request";
import { useLatest } from "./use-latest";

/** Longest delay before the next try if the service could not be reached, ms. */
const RETRY_MS = 2000;

export interface Query<T> {
  data?: T;
  error?: unknown;
  refetch: () => Promise<void>;
}

/**
 * Fetches when `key` changes, again `interval` ms after each response if given, and soon if the service
 * could not be reached. Keeps the last data while fetching fails; ignores the response of a fetch if a later one
 * has started.
 */
export function useQuery<T>(fetch: () => Promise<T>, key: unknown, interval?: number): Query<T> {
  const [response, setResponse] = useState<{ key: unknown; data?: T; error?: unknown }>({ key });
  const latestFetch = useLatest(fetch);
  /** Number of the latest fetch; responses of earlier ones are ignored. */
  const newest = useRef(0);
  /** Whether the service could not be reached. */
  const hasFailed = useRef(false);
  const ignorePending = useCallback(() => void newest.current++, []);
  const refetch = useCallback(async () => {
    const turn = ++newest.current;
    try {
      const data = await latestFetch.current();
      if (turn !== newest.current) return;
      hasFailed.current = false;
      setResponse({ key, data });
    } catch (error) {
      if (turn !== newest.current) return;
      hasFailed.current = isUnreachable(error);
      setResponse((before) => ({ key, data: before.key === key ? before.data : undefined, error }));
    }
  }, [key, latestFetch]);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    let stopped = false;
    const loop = async () => {
      await refetch();
      const wait = hasFailed.current ? Math.min(interval ?? RETRY_MS, RETRY_MS) : interval;
      if (wait && !stopped) timer = setTimeout(() => void loop(), wait);
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
