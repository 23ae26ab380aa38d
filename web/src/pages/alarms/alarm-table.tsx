import type { Advice, Alarm } from "../../api/alarms";
import { AlarmRow } from "./alarm-row";
import { alarmKey } from "./use-alarms";

interface Props {
  alarms: Alarm[];
  now: number;
  advice?: Advice;
  refetchAdvice: () => Promise<unknown>;
  chosen: Set<string>;
  choose: (chosen: Set<string>) => void;
}

export function AlarmTable({ alarms, now, advice, refetchAdvice, chosen, choose }: Props) {
  const open = alarms.filter((alarm) => !alarm.acknowledgement).map(alarmKey);
  const areAllChosen = open.length > 0 && open.every((key) => chosen.has(key));
  const toggle = (key: string) => {
    const next = new Set(chosen);
    if (!next.delete(key)) next.add(key);
    choose(next);
  };
  return (
    <div class="scroll">
      <table class="list alarms">
        <thead>
          <tr>
            <th>
              <input
                type="checkbox"
                aria-label="Choose all that are unacknowledged"
                checked={areAllChosen}
                disabled={!open.length}
                onChange={() => choose(new Set(areAllChosen ? [] : open))}
              />
            </th>
            <th>Rig</th>
            <th>Fault</th>
            <th>State</th>
            <th>Began</th>
            <th>Acknowledged</th>
          </tr>
        </thead>
        <tbody>
          {alarms.map((alarm) => (
            <AlarmRow
              key={alarmKey(alarm)}
              alarm={alarm}
              now={now}
              advice={advice}
              refetchAdvice={refetchAdvice}
              isChosen={chosen.has(alarmKey(alarm))}
              toggle={() => toggle(alarmKey(alarm))}
            />
          ))}
        </tbody>
      </table>
    </div>
  );
}
