import { announceUnauthenticated } from "../../api/access";
import { api } from "../../api/client";
import { ActionButton } from "../action-button";
import { useCaller } from "./caller";

/** Who is logged in, and the button to log out; nothing where no token is asked for. */
export function LoggedIn() {
  const caller = useCaller();
  if (!caller?.name) return null;
  const logOut = () => api.logOut().then(announceUnauthenticated);
  return (
    <span class="who">
      <span class="quiet" title={`role ${caller.role}`}>
        {caller.name}
      </span>{" "}
      <ActionButton class="small" action={logOut}>
        Log out
      </ActionButton>
    </span>
  );
}
