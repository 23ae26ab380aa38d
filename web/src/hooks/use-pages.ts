import { useState } from "preact/hooks";
import type { Page } from "../api/types";
import { useQuery } from "./use-query";

/** The items of one selection when a further page was loaded, and that page. */
interface LoadedPages<T> {
  key: string;
  items: T[];
  next?: string | null;
}

/** The items that are loaded, and how to load more. */
export interface Pages<T> {
  /** Missing until the first page is there. */
  items?: T[];
  error?: unknown;
  refetch: () => Promise<void>;
  /** Missing if all are loaded. */
  loadMore?: () => Promise<void>;
}

/**
 * A list in pages: the first page is fetched when `key` changes and every `interval` ms, `loadMore` fetches the
 * next one.
 */
export function usePages<T extends { id: string }>(
  fetchPage: (cursor?: string | null) => Promise<Page<T>>,
  key: string,
  interval: number,
): Pages<T> {
  const { data: first, error, refetch } = useQuery(() => fetchPage(), key, interval);
  const [loaded, setLoaded] = useState<LoadedPages<T>>();
  const rest = loaded?.key === key ? loaded : undefined;
  const known = new Set(first?.items.map((item) => item.id));
  const others = (rest?.items ?? []).filter((item) => !known.has(item.id));
  const next = rest ? rest.next : first?.next;
  const loadMore = async () => {
    // New items will push those of the first page out of it.
    const before = rest?.items ?? first?.items ?? [];
    const page = await fetchPage(next);
    setLoaded({ key, items: [...before, ...page.items], next: page.next });
  };
  return {
    items: first && [...first.items, ...others],
    error,
    refetch,
    loadMore: next ? loadMore : undefined,
  };
}
