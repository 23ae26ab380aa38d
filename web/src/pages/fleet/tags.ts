/** The tags of the fleet, and its rigs by them. */
import type { FleetEntry } from "../../api/types";
import type { FleetRow } from "./rows";

/** The tags of all rigs, in alphabetical order. */
export const tagsOf = (fleet: FleetEntry[]): string[] =>
  [...new Set(fleet.flatMap(({ tags }) => tags))].sort();

/** Returns the rigs with `tag`; all without one. */
export const tagged = (fleet: FleetEntry[], tag: string): FleetEntry[] =>
  tag ? fleet.filter(({ tags }) => tags.includes(tag)) : fleet;

/** The rigs with one tag; without a name those that have none. */
export interface TagGroup {
  tag?: string;
  rows: FleetRow[];
}

/**
 * Returns a group for each tag. A rig is in the group of each of its tags. The groups are in the order of
 * their first rows.
 */
export function groupsByTag(rows: FleetRow[]): TagGroup[] {
  const groups = new Map<string | undefined, TagGroup>();
  for (const row of rows) {
    const tags = row.entry.tags.length ? row.entry.tags : [undefined];
    for (const tag of tags) {
      const group = groups.get(tag) ?? { tag, rows: [] };
      group.rows.push(row);
      groups.set(tag, group);
    }
  }
  return [...groups.values()];
}
