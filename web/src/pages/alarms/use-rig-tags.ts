import { useMemo } from "preact/hooks";
import { api } from "../../api/client";
import type { FleetEntry } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import type { RigTags } from "./arranged";

/** Interval between two requests, ms: tags seldom change. */
const INTERVAL_MS = 60_000;

/** The tags of the rigs, if they are wanted. */
export function useRigTags(isWanted: boolean): RigTags {
  const fetch = (): Promise<FleetEntry[]> => (isWanted ? api.fleet() : Promise.resolve([]));
  const { data } = useQuery(fetch, `tags of rigs ${isWanted}`, INTERVAL_MS);
  return useMemo(
    () => new Map((data ?? []).filter(({ tags }) => tags.length).map(({ asset, tags }) => [asset, tags])),
    [data],
  );
}
