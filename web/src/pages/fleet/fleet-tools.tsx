import { Choice } from "../../parts/choice";
import { Filters } from "../../parts/filters";
import { TagChoice } from "../../parts/tag-choice";
import { count } from "../../words/numbers";
import { countRows, SORTS, type HealthFilter } from "./rows";
import type { FleetView } from "./use-fleet-view";

const FILTERS: { key: HealthFilter; word: string }[] = [
  { key: "all", word: "All" },
  { key: "fault", word: "Fault" },
  { key: "suspect", word: "Suspected" },
  { key: "recorded", word: "On record" },
  { key: "drift", word: "Drifting" },
  { key: "untested", word: "Not tested" },
  { key: "unlearnt", word: "Not calibrated" },
  { key: "ok", word: "No fault" },
  { key: "silent", word: "No data" },
  { key: "idle", word: "No session" },
];

const SEARCH = "Search rigs, faults, sessions";

/** Filters, search, order and layout of the rigs. */
export function FleetTools({ view }: { view: FleetView }) {
  const { rows, filter, search, sort, tag, tags, layout, change } = view;
  return (
    <div class="tools">
      <div class="chips" role="group" aria-label="Show">
        {FILTERS.map(({ key, word }) => (
          <button
            type="button"
            class={`filter filter-${key}`}
            aria-pressed={filter === key}
            onClick={() => change("health", key === "all" ? "" : key)}
          >
            {word} <b>{count(countRows(rows, key))}</b>
          </button>
        ))}
      </div>
      <input
        type="search"
        aria-label={SEARCH}
        placeholder={SEARCH}
        value={search}
        onInput={(e) => change("search", e.currentTarget.value)}
      />
      <Filters n={[tag, layout === "wall" ? layout : ""].filter(Boolean).length}>
        <TagChoice tags={tags} chosen={tag} change={(chosen) => change("tag", chosen)} />
        <Choice<string>
          isInline
          label="Sort"
          options={Object.entries(SORTS)}
          value={sort}
          change={(key) => change("sort", key)}
        />
        <button type="button" onClick={() => change("layout", layout === "wall" ? "" : "wall")}>
          {layout === "wall" ? "List view" : "Wall view"}
        </button>
      </Filters>
    </div>
  );
}
