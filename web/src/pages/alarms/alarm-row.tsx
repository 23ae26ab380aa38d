import type { Advice, Alarm } from "../../api/alarms";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { alarmPath, alarmState, alarmTitle } from "../../words/alarm";
import { dateTime, timeAgo } from "../../words/time";
import { WhatToDo } from "./what-to-do";

interface Props {
  alarm: Alarm;
  now: number;
  advice?: Advice;
  refetchAdvice: () => Promise<unknown>;
  isChosen: boolean;
  toggle: () => void;
}

export function AlarmRow({ alarm, now, advice, refetchAdvice, isChosen, toggle }: Props) {
  const { asset, acknowledgement, evidence, since } = alarm;
  const { text, look } = alarmState(alarm);
  // Without data there is none, which the alarm itself says.
  const hasEvidence = alarm.code !== "communication_lost";
  return (
    <tr>
      <td>
        <input
          type="checkbox"
          aria-label={`Choose ${alarmTitle(alarm)} of ${asset}`}
          checked={isChosen && !acknowledgement}
          disabled={!!acknowledgement}
          onChange={toggle}
        />
      </td>
      <th scope="row">
        <Link to={rigPath(asset)}>{asset}</Link>
      </th>
      <td>
        <Link to={alarmPath(alarm)}>{alarmTitle(alarm)}</Link>
        {advice && (
          <details>
            <summary>What to do</summary>
            <WhatToDo fault={alarm} advice={advice} refetch={refetchAdvice} />
          </details>
        )}
        {hasEvidence && evidence.reason && <p class="quiet small-text">Evidence: {evidence.reason}.</p>}
      </td>
      <td>
        <span class={look}>{text}</span>
        {alarm.muted && <p class="quiet small-text">{alarm.muted.reason}</p>}
      </td>
      <td data-word="began" title={dateTime(since)}>
        {since ? timeAgo(since, now) : "–"}
      </td>
      <td data-word="acknowledged">
        {acknowledgement ? `${acknowledgement.by}, ${timeAgo(acknowledgement.at, now)}` : "–"}
      </td>
    </tr>
  );
}
