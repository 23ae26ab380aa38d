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
  { key: "unlearnt", word: "Not learnt" },
  { key: "ok", word: "No fault" },
  { key: "silent", word: "Silent" },
  { key: "idle", word: "No session" },
];

const SEARCH = "Search rigs, faults, sessions";

/** Filters, search and order of the list of rigs. */
export function FleetTools({ view: { rows, filter, search, sort, change } }: { view: FleetView }) {
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
      <label class="inline">
        Sort{" "}
        <select value={sort} onChange={(e) => change("sort", e.currentTarget.value)}>
          {Object.entries(SORTS).map(([key, word]) => (
            <option value={key}>{word}</option>
          ))}
        </select>
      </label>
    </div>
  );
}
