import type { AlarmFilter } from "../../api/alarms";
import { tagApi } from "../../api/tags";
import { useQuery } from "../../hooks/use-query";
import { Choice } from "../../parts/choice";
import { Filters } from "../../parts/filters";
import { TagChoice } from "../../parts/tag-choice";
import type { AlarmKey } from "./alarm-filter";
import { GROUPS, ORDERS } from "./arranged";
import { FaultChoice } from "./fault-choice";
import { LastChangeChoice } from "./last-change-choice";

const STATES = [
  ["active", "Failing, suspected or on record"],
  ["failing", "Failing"],
  ["suspected", "Suspected"],
  ["on_record", "Passing again, on record"],
  ["all", "All, including healed"],
] as const;

/** The parameters that select or order alarms. */
const KEYS: AlarmKey[] = ["state", "code", "hours", "rig", "tag", "acknowledged", "sort", "group"];

interface Props {
  filter: AlarmFilter;
  /** The value of a parameter of the address; empty if it is missing. */
  word: (key: AlarmKey) => string;
  change: (key: AlarmKey, value: string) => void;
}

/** The filter, order and grouping of the list. */
export function AlarmTools({ filter, word, change }: Props) {
  const { data: tags } = useQuery(tagApi.inUse, "tags");
  return (
    <Filters n={KEYS.filter(word).length}>
      <Choice<string>
        label="State"
        options={STATES}
        value={filter.state ?? ""}
        change={(state) => change("state", state)}
      />
      <FaultChoice code={filter.code} change={(code) => change("code", code ?? "")} />
      <LastChangeChoice hours={word("hours")} change={(hours) => change("hours", hours)} />
      <label>
        Rig
        <input
          type="search"
          placeholder="part of its name"
          value={word("rig")}
          onInput={(e) => change("rig", e.currentTarget.value.trim())}
        />
      </label>
      <TagChoice isAbove tags={tags ?? []} chosen={filter.tag ?? ""} change={(tag) => change("tag", tag)} />
      <Choice<string>
        label="Order"
        options={Object.entries(ORDERS)}
        value={word("sort")}
        change={(sort) => change("sort", sort)}
      />
      <Choice<string>
        label="Group by"
        options={Object.entries(GROUPS)}
        value={word("group")}
        change={(group) => change("group", group)}
      />
      <label class="check">
        <input
          type="checkbox"
          checked={filter.acknowledged === false}
          onChange={(e) => change("acknowledged", e.currentTarget.checked ? "false" : "")}
        />
        Unacknowledged only
      </label>
    </Filters>
  );
}
