import type { Advice, Alarm } from "../../api/alarms";
import { OwnNote } from "./own-note";

/** A fault, whether it is in the list of alarms or in the memory of its rig. */
type AdvisedFault = Pick<Alarm, "code" | "kind">;

/** The checks for a kind of fault; those of the code if the kind has no checks itself. */
function checksFor(advice: Advice, { code, kind }: AdvisedFault): string[] {
  const ofCode = advice.items.filter((item) => item.code === code);
  const own = ofCode.find((item) => item.kind === (kind ?? null));
  return (own ?? ofCode.find((item) => !item.kind))?.checks ?? [];
}

interface Props {
  fault: AdvisedFault;
  advice: Advice;
  refetch: () => Promise<unknown>;
}

/** What to do about a fault: checks, and the owner's own note. */
export function WhatToDo({ fault, advice, refetch }: Props) {
  return (
    <div class="what-to-do">
      <ol>
        {checksFor(advice, fault).map((check) => (
          <li>{check}</li>
        ))}
      </ol>
      <OwnNote code={fault.code} advice={advice} refetch={refetch} />
    </div>
  );
}
