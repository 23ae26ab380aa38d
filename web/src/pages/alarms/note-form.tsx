import { useState } from "preact/hooks";
import { alarmApi, type AlarmCode } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";
import { alarmCodeTitle } from "../../words/alarm";

interface Props {
  code: AlarmCode;
  /** The note before. */
  text: string;
  refetch: () => Promise<unknown>;
  close: () => void;
}

/** Edits the owner's note on a fault. */
export function NoteForm({ code, text, refetch, close }: Props) {
  const [draft, setDraft] = useState(text);
  const actor = useActor();
  const save = async () => {
    actor.remember();
    await alarmApi.putNote(code, draft);
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
