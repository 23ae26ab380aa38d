import type { Advice, Alarm } from "../../api/alarms";
import { Term } from "../../parts/term";
import { AlarmRow } from "./alarm-row";
import type { AlarmGroup } from "./arranged";
import { alarmKey } from "./use-alarms";

interface Props {
  /** All alarms that are chosen by the box in the head. */
  alarms: Alarm[];
  /** Those that are shown. */
  groups: AlarmGroup[];
  now: number;
  advice?: Advice;
  refetchAdvice: () => Promise<unknown>;
  chosen: Set<string>;
  choose: (chosen: Set<string>) => void;
}

export function AlarmTable({ alarms, groups, now, advice, refetchAdvice, chosen, choose }: Props) {
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
        <Head
          areAllChosen={areAllChosen}
          isDisabled={!open.length}
          choose={() => choose(new Set(areAllChosen ? [] : open))}
        />
        <tbody>
          {groups.map(({ heading, alarms, total }) => (
            <>
              {heading && (
                <tr class="group">
                  <th colSpan={6} scope="rowgroup">
                    {heading} <span class="quiet">({total})</span>
                  </th>
                </tr>
              )}
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
            </>
          ))}
        </tbody>
      </table>
    </div>
  );
}

interface HeadProps {
  areAllChosen: boolean;
  isDisabled: boolean;
  /** Chooses all alarms that are unacknowledged, or none. */
  choose: () => void;
}

const Head = ({ areAllChosen, isDisabled, choose }: HeadProps) => (
  <thead>
    <tr>
      <th>
        <input
          type="checkbox"
          aria-label="Choose all that are unacknowledged"
          checked={areAllChosen}
          disabled={isDisabled}
          onChange={choose}
        />
      </th>
      <th>Rig</th>
      <th>Fault</th>
      <th>
        <Term of="state">State</Term>
      </th>
      <th>Began</th>
      <th>Acknowledged</th>
    </tr>
  </thead>
);
