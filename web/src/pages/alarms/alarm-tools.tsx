import type { AlarmFilter } from "../../api/alarms";
import { TagChoice } from "../../parts/tag-choice";
import { FaultChoice } from "./fault-choice";
import { LastChangeChoice } from "./last-change-choice";

const STATES = [
  ["active", "Failing or on record"],
  ["failing", "Failing now"],
  ["on_record", "Passing, on record"],
  ["all", "All, healed ones too"],
] as const;

/** The filter of the list. */
export function AlarmTools({
  filter,
  tags,
  change,
}: {
  filter: AlarmFilter;
  /** The tags in use. */
  tags: string[];
  change: (filter: AlarmFilter) => void;
}) {
  return (
    <div class="form-row">
      <label>
        State
        <select value={filter.state} onChange={(e) => change({ ...filter, state: e.currentTarget.value })}>
          {STATES.map(([value, word]) => (
            <option value={value}>{word}</option>
          ))}
        </select>
      </label>
      <FaultChoice code={filter.code} change={(code) => change({ ...filter, code })} />
      <LastChangeChoice change={(from) => change({ ...filter, from })} />
      <label>
        Rig
        <input
          type="search"
          placeholder="whole name"
          value={filter.asset ?? ""}
          onChange={(e) => change({ ...filter, asset: e.currentTarget.value.trim() || undefined })}
        />
      </label>
      <TagChoice
        tags={tags}
        chosen={filter.tag ?? ""}
        change={(tag) => change({ ...filter, tag: tag || undefined })}
      />
      <label class="check">
        <input
          type="checkbox"
          checked={filter.acknowledged === false}
          onChange={(e) => change({ ...filter, acknowledged: e.currentTarget.checked ? false : undefined })}
        />
        Nobody has acknowledged
      </label>
    </div>
  );
}
