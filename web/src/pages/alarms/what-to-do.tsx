import { useState } from "preact/hooks";
import { alarmApi, type Advice, type Alarm } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { alarmCodeTitle } from "../../words/alarm";

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
  const note = advice.notes.find(({ code }) => code === alarm.code);
  const [draft, setDraft] = useState<string>();
  const save = async () => {
    await alarmApi.putNote(alarm.code, draft ?? "");
    await refetch();
    setDraft(undefined);
  };
  return (
    <details class="what-to-do">
      <summary>What to do</summary>
      <ol>
        {checksFor(advice, alarm).map((check) => (
          <li>{check}</li>
        ))}
      </ol>
      {draft === undefined ? (
        <p>
          {note && (
            <span class="own-note">
              {note.text} <span class="quiet">({note.by})</span>{" "}
            </span>
          )}
          <button type="button" class="link" onClick={() => setDraft(note?.text ?? "")}>
            {note ? "Edit the note" : "Add a note"}
          </button>
        </p>
      ) : (
        <div class="note-form">
          <label>
            Note on every fault “{alarmCodeTitle(alarm.code)}”
            <textarea
              rows={3}
              maxLength={2000}
              value={draft}
              onInput={(e) => setDraft(e.currentTarget.value)}
            />
          </label>
          <ActionButton class="small" action={save}>
            Keep
          </ActionButton>{" "}
          <button type="button" class="small" onClick={() => setDraft(undefined)}>
            Cancel
          </button>
        </div>
      )}
    </details>
  );
}
