import { useState } from "preact/hooks";
import type { Advice, AlarmCode } from "../../api/alarms";
import { useRefusal } from "../../parts/login/rights";
import { NoteForm } from "./note-form";

interface Props {
  code: AlarmCode;
  advice: Advice;
  refetch: () => Promise<unknown>;
}

/** The owner's own note on a fault, which can be edited. */
export function OwnNote({ code, advice, refetch }: Props) {
  const [isEdited, setEdited] = useState(false);
  const refused = useRefusal("operator");
  const note = advice.notes.find((note) => note.code === code);
  if (isEdited) {
    return <NoteForm code={code} note={note} refetch={refetch} close={() => setEdited(false)} />;
  }
  return (
    <p>
      {note && (
        <span class="own-note">
          {note.text} <span class="quiet">({note.by})</span>{" "}
        </span>
      )}
      <button
        type="button"
        class="link no-print"
        disabled={refused !== undefined}
        title={refused}
        onClick={() => setEdited(true)}
      >
        {note ? "Edit the remark" : "Add a remark"}
      </button>
    </p>
  );
}
