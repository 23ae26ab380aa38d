import { useState } from "preact/hooks";
import { alarmApi, type Alarm } from "../../api/alarms";
import { useNow } from "../../hooks/use-now";
import { useQuery } from "../../hooks/use-query";
import { count, plural } from "../../words/numbers";
import { AlarmTable } from "./alarm-table";
import { grouped } from "./arranged";
import { useRigTags } from "./use-rig-tags";

/** Number of alarms that are shown at first, and more each time. */
const SHOWN = 100;

interface Props {
  alarms: Alarm[];
  /** What they are grouped by. */
  group: string;
  chosen: Set<string>;
  choose: (chosen: Set<string>) => void;
}

/** The number of alarms, and the first of them. */
export function AlarmList({ alarms, group, chosen, choose }: Props) {
  const advice = useQuery(alarmApi.advice, "advice");
  const now = useNow();
  const [n, setN] = useState(SHOWN);
  const tags = useRigTags(group === "tag");
  return (
    <>
      <p class="quiet small-text" role="status">
        {plural(alarms.length, "alarm")}
      </p>
      <AlarmTable
        alarms={alarms}
        groups={grouped(alarms, group, tags, n)}
        now={now}
        advice={advice.data}
        refetchAdvice={advice.refetch}
        chosen={chosen}
        choose={choose}
      />
      {alarms.length > n && (
        <p>
          <button type="button" onClick={() => setN(n + SHOWN)}>
            Show more of {count(alarms.length)}
          </button>
        </p>
      )}
    </>
  );
}
