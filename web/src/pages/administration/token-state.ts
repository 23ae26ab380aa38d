import type { Role, Token } from "../../api/administration";
import { dateTime } from "../../words/time";

/** What each role may do, in a few words. */
export const ROLES: Record<Role, string> = {
  device: "sends the samples of one rig",
  viewer: "sees everything",
  operator: "also sets up, imports and acknowledges",
  admin: "also deletes, and makes tokens",
};

export const isInForce = ({ expires_at, revoked_at }: Token, now: number): boolean =>
  !revoked_at && (!expires_at || Date.parse(expires_at) > now);

/** Whether a token can be used, and until when. */
export function tokenState(token: Token, now: number): string {
  const { expires_at, revoked_at } = token;
  if (revoked_at) return `revoked ${dateTime(revoked_at)}`;
  if (!expires_at) return "valid";
  return isInForce(token, now) ? `valid until ${dateTime(expires_at)}` : `expired ${dateTime(expires_at)}`;
}
