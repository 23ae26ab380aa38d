import type { AlarmFilter } from "../../api/alarms";
import { ALARM_CODES, alarmCodeTitle } from "../../words/alarm";

const STATES = [
  ["active", "Failing or on record"],
  ["failing", "Failing now"],
  ["on_record", "Passing, on record"],
  ["all", "All, healed ones too"],
] as const;

/** Ranges of the last change, hours back. */
const RANGES = [
  [0, "At any time"],
  [1, "In the last hour"],
  [24, "In the last day"],
  [168, "In the last week"],
] as const;

/** The range is rounded to minutes, so that the filter stays the same for a while. */
function since(hours: number): string | undefined {
  if (!hours) return undefined;
  const minute = 60_000;
  return new Date(Math.floor(Date.now() / minute) * minute - hours * 3_600_000).toISOString();
}

/** The filter of the list. */
export function AlarmTools({
  filter,
  change,
}: {
  filter: AlarmFilter;
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
      <label>
        Fault
        <select
          value={filter.code ?? ""}
          onChange={(e) => change({ ...filter, code: e.currentTarget.value || undefined })}
        >
          <option value="">Any</option>
          {ALARM_CODES.map((code) => (
            <option value={code}>{alarmCodeTitle(code)}</option>
          ))}
        </select>
      </label>
      <label>
        Last change
        <select onChange={(e) => change({ ...filter, from: since(Number(e.currentTarget.value)) })}>
          {RANGES.map(([hours, word]) => (
            <option value={hours}>{word}</option>
          ))}
        </select>
      </label>
      <label>
        Rig
        <input
          type="search"
          placeholder="whole name"
          value={filter.asset ?? ""}
          onChange={(e) => change({ ...filter, asset: e.currentTarget.value.trim() || undefined })}
        />
      </label>
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
