import type { Role, TokenRequest } from "../../api/administration";

/** What the form of a token holds. */
export interface TokenDraft {
  name: string;
  role: Role;
  /** The rig of a device. */
  asset: string;
  /** Local date and time of the expiry, as the field gives it; empty if the token does not expire. */
  expires: string;
}

export const EMPTY_DRAFT: TokenDraft = { name: "", role: "viewer", asset: "", expires: "" };

/** The token that the form describes. */
export function tokenOf({ name, role, asset, expires }: TokenDraft): TokenRequest {
  return {
    name: name.trim(),
    role,
    asset: role === "device" ? asset.trim() : null,
    expires_at: expires ? new Date(expires).toISOString() : null,
  };
}

/** What is missing or wrong in the form at the time `now`, ms since 1970; empty if nothing is. */
export function obstacle({ name, role, asset, expires }: TokenDraft, now: number): string {
  if (!name.trim()) return "Give it a name.";
  if (role === "device" && !asset.trim()) return "Choose the rig of the device.";
  return expires && Date.parse(expires) <= now ? "The expiry has passed already." : "";
}
