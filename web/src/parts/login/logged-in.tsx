import { announceUnauthenticated } from "../../api/access";
import { api } from "../../api/client";
import { ActionButton } from "../action-button";
import { useCaller } from "./caller";

/** The logged-in user and the button to log out; empty if the service requires no token. */
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
