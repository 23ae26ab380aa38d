/** The fleet for a screen on the wall: one tile for each rig, to be read from a distance. */
import { count } from "../../words/numbers";
import type { FleetRow } from "./rows";
import { groupsByTag, type TagGroup } from "./tags";
import { WallTile } from "./wall-tile";

/** Number of displayed tiles of a group: more can be read on no screen. */
const MAX_TILES = 200;

function Group({ tag, rows, isOnly }: TagGroup & { isOnly: boolean }) {
  const title = tag ?? (isOnly ? "All rigs" : "Without a tag");
  return (
    <section class="wall-group" aria-label={title}>
      {!(isOnly && tag === undefined) && <h2>{title}</h2>}
      <ul class="wall">
        {rows.slice(0, MAX_TILES).map((row) => (
          <li key={row.entry.asset}>
            <WallTile row={row} />
          </li>
        ))}
      </ul>
      {rows.length > MAX_TILES && <p class="quiet">and {count(rows.length - MAX_TILES)} more</p>}
    </section>
  );
}

export function FleetWall({ rows }: { rows: FleetRow[] }) {
  const groups = groupsByTag(rows);
  if (!groups.length) return <p class="quiet">No rig matches.</p>;
  return (
    <>
      {groups.map((group) => (
        <Group key={group.tag ?? ""} {...group} isOnly={groups.length === 1} />
      ))}
    </>
  );
}
