import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { Dialog } from "../../parts/dialog";
import { navigate } from "../../router/navigation";
import { sessionsPath } from "../../router/paths";
import { count } from "../../words/numbers";

export function DeleteDialog({ session, close }: { session: Session; close: () => void }) {
  const deleteSession = async () => {
    await api.deleteSession(session.id);
    navigate(sessionsPath());
  };
  return (
    <Dialog title="Delete this session?" close={close}>
      <p>
        This permanently deletes the recording of {count(session.samples)} samples and its verdict. The fault
        memory of the rig is not changed.
      </p>
      <div class="form-end">
        <button type="button" onClick={close}>
          Cancel
        </button>
        <ActionButton class="danger" action={deleteSession}>
          Delete
        </ActionButton>
      </div>
    </Dialog>
  );
}
