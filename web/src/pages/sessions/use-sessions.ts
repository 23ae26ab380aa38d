import { api } from "../../api/client";
import type { SessionQuery } from "../../api/types";
import { usePages } from "../../hooks/use-pages";

/** Number of sessions per page. */
const PAGE = 100;
const INTERVAL_MS = 5000;

/** The sessions that `filter` selects. */
export const useSessions = (filter: SessionQuery) =>
  usePages(
    (cursor) => api.sessions({ ...filter, cursor, limit: PAGE }),
    `sessions ${JSON.stringify(filter)}`,
    INTERVAL_MS,
  );
