import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import { onUnauthenticated } from "../../api/access";
import { api } from "../../api/client";
import { isUnauthenticated } from "../../api/request";
import { useQuery } from "../../hooks/use-query";
import { UnloadedPage } from "../unloaded-page";
import { CallerContext } from "./caller";
import { LoginPage } from "./login-page";

/** Shows the page to an authenticated caller, and the login if the service requires a token. */
export function LoginGate({ children }: { children: ComponentChildren }) {
  const caller = useQuery(api.caller, "caller");
  const { refetch } = caller;
  useEffect(() => onUnauthenticated(() => void refetch()), [refetch]);
  if (isUnauthenticated(caller.error)) return <LoginPage loggedIn={refetch} />;
  if (!caller.data) return <UnloadedPage what="the page" error={caller.error} retry={refetch} />;
  return <CallerContext.Provider value={caller.data}>{children}</CallerContext.Provider>;
}
