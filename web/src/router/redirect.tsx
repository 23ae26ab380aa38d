import { useLayoutEffect } from "preact/hooks";
import { navigate } from "./navigation";

/** Leads from another address of a view to the view, without an entry in the history. */
export function Redirect({ to }: { to: string }) {
  useLayoutEffect(() => navigate(to, true), [to]);
  return null;
}
