import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";

/** Sessions that are fetched at once. */
const PAGE = 100;
const INTERVAL_MS = 5000;

/** Sessions beyond the first page, of one rig or of all. */
interface Rest {
  asset: string;
  items: Session[];
  next?: string | null;
}

/** The sessions of a rig, or of all: the first page as it is now, others when `loadMore` is asked. */
export function useSessions(asset: string) {
  const fetchFirst = () => api.sessions({ asset, limit: PAGE });
  const { data: first, error, refetch } = useQuery(fetchFirst, `sessions ${asset}`, INTERVAL_MS);
  const [loaded, setLoaded] = useState<Rest>();
  const rest = loaded?.asset === asset ? loaded : undefined;
  // What begins meanwhile pushes sessions of the first page into the rest.
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
