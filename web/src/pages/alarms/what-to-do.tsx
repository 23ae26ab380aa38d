import type { Advice, Alarm } from "../../api/alarms";
import { OwnNote } from "./own-note";

/** The checks for a kind of fault; those of the code if the kind has none of its own. */
function checksFor(advice: Advice, { code, kind }: Alarm): string[] {
  const ofCode = advice.items.filter((item) => item.code === code);
  const own = ofCode.find((item) => item.kind === (kind ?? null));
  return (own ?? ofCode.find((item) => !item.kind))?.checks ?? [];
}

/** What to do about an alarm: checks, and the owner's own note. */
export function WhatToDo({
  alarm,
  advice,
  refetch,
}: {
  alarm: Alarm;
  advice: Advice;
  refetch: () => Promise<unknown>;
}) {
  return (
    <details class="what-to-do">
      <summary>What to do</summary>
      <ol>
        {checksFor(advice, alarm).map((check) => (
          <li>{check}</li>
        ))}
      </ol>
      <OwnNote code={alarm.code} advice={advice} refetch={refetch} />
    </details>
  );
}
