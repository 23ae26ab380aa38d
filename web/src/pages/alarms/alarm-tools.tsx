import type { AlarmFilter } from "../../api/alarms";
import { tagApi } from "../../api/tags";
import { useQuery } from "../../hooks/use-query";
import { Choice } from "../../parts/choice";
import { TagChoice } from "../../parts/tag-choice";
import type { AlarmKey } from "./alarm-filter";
import { FaultChoice } from "./fault-choice";
import { LastChangeChoice } from "./last-change-choice";

const STATES = [
  ["active", "Failing or on record"],
  ["failing", "Failing"],
  ["on_record", "Passing again, on record"],
  ["all", "All, including healed"],
] as const;

interface Props {
  filter: AlarmFilter;
  /** The range of the last change, hours back; empty for any time. */
  hours: string;
  change: (key: AlarmKey, value: string) => void;
}

/** The filter of the list. */
export function AlarmTools({ filter, hours, change }: Props) {
  const { data: tags } = useQuery(tagApi.inUse, "tags");
  return (
    <div class="form-row">
      <Choice<string>
        label="State"
        options={STATES}
        value={filter.state ?? ""}
        change={(state) => change("state", state)}
      />
      <FaultChoice code={filter.code} change={(code) => change("code", code ?? "")} />
      <LastChangeChoice hours={hours} change={(hours) => change("hours", hours)} />
      <label>
        Rig
        <input
          type="search"
          placeholder="whole name"
          value={filter.asset ?? ""}
          onChange={(e) => change("asset", e.currentTarget.value.trim())}
        />
      </label>
      <TagChoice isAbove tags={tags ?? []} chosen={filter.tag ?? ""} change={(tag) => change("tag", tag)} />
      <label class="check">
        <input
          type="checkbox"
          checked={filter.acknowledged === false}
          onChange={(e) => change("acknowledged", e.currentTarget.checked ? "false" : "")}
        />
        Unacknowledged only
      </label>
    </div>
  );
}
