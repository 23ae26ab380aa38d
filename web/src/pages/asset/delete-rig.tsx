import { api } from "../../api/client";
import { ConfirmButton } from "../../parts/confirm-button";
import { navigate } from "../../router/navigation";

/** Deletes the rig with all that is recorded of it, after a question. */
export function DeleteRig({ name }: { name: string }) {
  const deleteRig = async () => {
    await api.deleteAsset(name);
    navigate("/");
  };
  return (
    <ConfirmButton word="Delete this rig" question={`Delete ${name}?`} action={deleteRig} needs="admin">
      This permanently deletes the rig with all its sessions: their recordings, verdicts and remarks. Its
      faults with their history, its calibrations and its tags are lost too, and the tokens of its devices are
      revoked. Only the audit log keeps who deleted it.
    </ConfirmButton>
  );
}
