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
        The recording of {count(session.samples)} samples and its verdict are gone for good. The rig's fault
        memory keeps what the session left in it.
      </p>
      <div class="form-end">
        <button type="button" onClick={close}>
          Keep it
        </button>
        <ActionButton class="danger" action={deleteSession}>
          Delete
        </ActionButton>
      </div>
    </Dialog>
  );
}
