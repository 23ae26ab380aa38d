import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";

/** Number of sessions per page. */
const PAGE = 100;
const INTERVAL_MS = 5000;

/** Sessions after the first page, of one rig or of all. */
interface FurtherPages {
  asset: string;
  items: Session[];
  next?: string | null;
}

/** The sessions of one rig or of all: the first page is polled, `loadMore` fetches the next one. */
export function useSessions(asset: string) {
  const fetchFirst = () => api.sessions({ asset, limit: PAGE });
  const { data: first, error, refetch } = useQuery(fetchFirst, `sessions ${asset}`, INTERVAL_MS);
  const [loaded, setLoaded] = useState<FurtherPages>();
  const rest = loaded?.asset === asset ? loaded : undefined;
  // New sessions push sessions of the first page to the further pages.
  const known = new Set(first?.items.map((session) => session.id));
  const others = (rest?.items ?? []).filter((session) => !known.has(session.id));
  const next = rest ? rest.next : first?.next;
  const loadMore = async () => {
    const page = await api.sessions({ asset, limit: PAGE, cursor: next });
    setLoaded({ asset, items: [...(rest?.items ?? []), ...page.items], next: page.next });
  };
  return {
    sessions: first && [...first.items, ...others],
    error,
    refetch,
    loadMore: next ? loadMore : undefined,
  };
}
