import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";

/** Number of sessions per page. */
const PAGE = 100;
const INTERVAL_MS = 5000;

/** Sessions after the first page, of one selection. */
interface FurtherPages {
  key: string;
  items: Session[];
  next?: string | null;
}

/**
 * The sessions of one rig, of the rigs with a tag, or of all: the first page is polled, `loadMore` fetches the
 * next one.
 */
export function useSessions(asset: string, tag: string) {
  const key = `sessions ${asset} ${tag}`;
  const fetchFirst = () => api.sessions({ asset, tag, limit: PAGE });
  const { data: first, error, refetch } = useQuery(fetchFirst, key, INTERVAL_MS);
  const [loaded, setLoaded] = useState<FurtherPages>();
  const rest = loaded?.key === key ? loaded : undefined;
  // New sessions push sessions of the first page to the further pages.
  const known = new Set(first?.items.map((session) => session.id));
  const others = (rest?.items ?? []).filter((session) => !known.has(session.id));
  const next = rest ? rest.next : first?.next;
  const loadMore = async () => {
    const page = await api.sessions({ asset, tag, limit: PAGE, cursor: next });
    setLoaded({ key, items: [...(rest?.items ?? []), ...page.items], next: page.next });
  };
  return {
    sessions: first && [...first.items, ...others],
    error,
    refetch,
    loadMore: next ? loadMore : undefined,
  };
}
