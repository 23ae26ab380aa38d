import { api } from "../../api/client";
import { ActionButton } from "../../parts/action-button";
import { useCaller } from "../../parts/login/caller";

interface Props {
  asset: string;
  /** Called with the token that was made. */
  made: (secret: string) => void;
}

/** By which token the device sends: a place for it, or a new one for who may make it. */
export function DeviceToken({ asset, made }: Props) {
  const caller = useCaller();
  if (caller?.authentication !== "required")
    return (
      <>The service asks for no token. Whoever reaches this address can send; keep it within your network.</>
    );
  const make = async () => made((await api.createDeviceToken(asset)).secret);
  return (
    <>
      The device shows its token; put it where the snippet says <code>offbd_TOKEN</code>.
      {caller.role === "admin" ? (
        <>
          {" "}
          <ActionButton class="small" action={make}>
            Make a token for this rig
          </ActionButton>{" "}
          It is shown this once.
        </>
      ) : (
        " An administrator makes one."
      )}
    </>
  );
}
