import { api } from "../../../api/client";
import { useQuery } from "../../../hooks/use-query";

/** Polling interval, ms; trends change only when a session ends. */
const INTERVAL_MS = 30_000;

export const useTrends = (name: string) => useQuery(() => api.trends(name), `${name} trends`, INTERVAL_MS);
