import { api } from "../../api/client";
import { ActionButton } from "../../parts/action-button";
import { useCaller } from "../../parts/login/caller";

interface Props {
  asset: string;
  /** Called with the created token. */
  created: (secret: string) => void;
}

/** The note on the device's token; administrators can create one. */
export function DeviceToken({ asset, created }: Props) {
  const caller = useCaller();
  if (caller?.authentication !== "required")
    return (
      <>The service requires no token while it listens on this computer only: every local user can send.</>
    );
  const create = async () => created((await api.createDeviceToken(asset)).secret);
  return (
    <>
      The device authenticates with a token; put it in the place of <code>offbd_TOKEN</code>.
      {caller.role === "admin" ? (
        <>
          {" "}
          <ActionButton class="small" action={create}>
            Create a token for this rig
          </ActionButton>{" "}
          It is shown only once.
        </>
      ) : (
        " An administrator can create one."
      )}
    </>
  );
}
