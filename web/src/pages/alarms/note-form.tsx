import { useState } from "preact/hooks";
import { alarmApi, type AlarmCode, type Note } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";
import { alarmCodeTitle } from "../../words/alarm";

interface Props {
  code: AlarmCode;
  /** The note before, if there is one. */
  note?: Note;
  refetch: () => Promise<unknown>;
  close: () => void;
}

/** Edits the owner's note on a fault. */
export function NoteForm({ code, note, refetch, close }: Props) {
  const [draft, setDraft] = useState(note?.text ?? "");
  // What is edited, also if somebody else changes the note meanwhile.
  const [before] = useState(note);
  const actor = useActor();
  const save = async () => {
    actor.remember();
    await alarmApi.putNote(code, draft, before);
    await refetch();
    close();
  };
  return (
    <div class="note-form">
      <label>
        Remark on every fault “{alarmCodeTitle(code)}”
        <textarea rows={3} maxLength={2000} value={draft} onInput={(e) => setDraft(e.currentTarget.value)} />
      </label>
      <ActorField actor={actor} />{" "}
      <ActionButton class="small" action={save} needs="operator">
        Save
      </ActionButton>{" "}
      <button type="button" class="small" onClick={close}>
        Cancel
      </button>
    </div>
  );
}
