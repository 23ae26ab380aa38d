import { tagApi } from "../../api/tags";
import { useDraft } from "../../hooks/use-draft";
import { useQuery } from "../../hooks/use-query";
import { Choice } from "../../parts/choice";
import { Filters } from "../../parts/filters";
import { TagChoice } from "../../parts/tag-choice";
import { RigChoice } from "./rig-choice";
import type { SessionKey } from "./session-filter";

const VERDICTS = [
  ["", "Any"],
  ["fault", "Fault"],
  ["no_fault", "No fault"],
] as const;

const SORTS = [
  ["", "Newest first"],
  ["opened_at", "Oldest first"],
] as const;

/** The parameters that select or order sessions. */
const KEYS: SessionKey[] = ["asset", "name", "verdict", "from", "to", "tag", "sort"];

interface Props {
  /** The names of all rigs. */
  names: string[];
  /** The value of a parameter of the address; empty if it is missing. */
  word: (key: SessionKey) => string;
  change: (key: SessionKey, value: string) => void;
}

/** A day of the range in which sessions were started. */
function DayField({
  label,
  field,
  word,
  change,
}: { label: string; field: "from" | "to" } & Omit<Props, "names">) {
  return (
    <label>
      {label}
      <input
        type="date"
        value={word(field)}
        min={field === "to" ? word("from") || undefined : undefined}
        onChange={(e) => change(field, e.currentTarget.value)}
      />
    </label>
  );
}

/** Selects and orders sessions. */
export function SessionTools({ names, word, change }: Props) {
  const { data: tags } = useQuery(tagApi.inUse, "tags");
  const name = useDraft(word("name"), (text) => change("name", text.trim()));
  return (
    <Filters n={KEYS.filter(word).length}>
      <RigChoice names={names} chosen={word("asset")} change={(name) => change("asset", name)} />
      <label>
        Session
        <input type="search" placeholder="begins with" {...name} />
      </label>
      <Choice<string>
        label="Verdict"
        options={VERDICTS}
        value={word("verdict")}
        change={(verdict) => change("verdict", verdict)}
      />
      <DayField label="Started from" field="from" word={word} change={change} />
      <DayField label="Started until" field="to" word={word} change={change} />
      <TagChoice isAbove tags={tags ?? []} chosen={word("tag")} change={(tag) => change("tag", tag)} />
      <Choice<string>
        label="Order"
        options={SORTS}
        value={word("sort")}
        change={(sort) => change("sort", sort)}
      />
    </Filters>
  );
}
