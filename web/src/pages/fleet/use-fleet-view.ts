import { useMemo, useRef } from "preact/hooks";
import type { FleetEntry } from "../../api/types";
import { navigate, useLocation } from "../../router/navigation";
import { chosenRows, nameRanks, rowOf, type HealthFilter } from "./rows";
import { tagged, tagsOf } from "./tags";

/** The rank of each rig by name; sorting thousands of names every second would take too long. */
function useNameRanks(fleet: FleetEntry[]): Map<string, number> {
  const names = fleet.map((entry) => entry.asset);
  const known = useRef<string[]>([]);
  const isSame = names.length === known.current.length && names.every((name, i) => name === known.current[i]);
  if (!isSame) known.current = names;
  const stableNames = known.current;
  return useMemo(() => nameRanks(stableNames), [stableNames]);
}

/** The parameters of the address. */
type FleetKey = "search" | "health" | "sort" | "tag" | "layout";

const NO_RIGS: FleetEntry[] = [];

/** The fleet with the search, filter and order of the address. */
export function useFleetView(fleet: FleetEntry[] = NO_RIGS) {
  const { query } = useLocation();
  const search = query.get("search") ?? "";
  const filter = (query.get("health") || "all") as HealthFilter;
  const sort = query.get("sort") ?? "severity";
  const tag = query.get("tag") ?? "";
  const layout = query.get("layout") === "wall" ? "wall" : "list";
  const change = (key: FleetKey, value: string) => {
    const next = new URLSearchParams(query);
    if (value) next.set(key, value);
    else next.delete(key);
    navigate(`/${next.size ? `?${next}` : ""}`, true);
  };
  const ranks = useNameRanks(fleet);
  const tags = useMemo(() => tagsOf(fleet), [fleet]);
  const rows = useMemo(() => tagged(fleet, tag).map((entry) => rowOf(entry, ranks)), [fleet, tag, ranks]);
  const shown = useMemo(() => chosenRows(rows, filter, search, sort), [rows, filter, search, sort]);
  return { search, filter, sort, tag, tags, layout, total: fleet.length, rows, shown, change };
}

export type FleetView = ReturnType<typeof useFleetView>;
