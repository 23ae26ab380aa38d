/** What the caller may do; the service decides, the page only says so beforehand. */
import type { Caller } from "../../api/types";
import { useCaller } from "./caller";

/** The role that an action needs. */
export type NeededRole = "operator" | "admin";

const ROLES: Record<NeededRole, Caller["role"][]> = {
  operator: ["operator", "admin"],
  admin: ["admin"],
};

/** Returns why `role` does not suffice; undefined if it does. */
export function refusal(
  needed: NeededRole | undefined,
  role: Caller["role"] | undefined,
): string | undefined {
  if (!needed || !role || ROLES[needed].includes(role)) return undefined;
  return `Needs the role ${needed}; yours is ${role}.`;
}

/** Why the caller must not do what `needed` is needed for; undefined if they may. */
export const useRefusal = (needed?: NeededRole) => refusal(needed, useCaller()?.role);
