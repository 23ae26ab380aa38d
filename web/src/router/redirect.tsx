import { useEffect } from "preact/hooks";
import { navigate } from "./navigation";

/** Leads from another address of a view to the view, without an entry in the history. */
export function Redirect({ to }: { to: string }) {
  // After the layout effects, with which the page begins to follow its address.
  useEffect(() => navigate(to, true), [to]);
  return null;
}
