/** What an audited operation was applied to. */
import { rigPath, sessionPath } from "../../router/paths";

export interface AuditTarget {
  text: string;
  /** The view that shows it; none if there is none. */
  path?: string;
}

/** What all targets begin with. */
const BASE = "/api/v1/";

/** The operations after which what they were applied to is there no more. */
const GONE = ["delete_asset", "delete_session"];

/** The words of the page for lists of the interface. */
const KINDS: Record<string, string> = { assets: "rig", sessions: "session", tokens: "token" };

/** Returns the operation in words, from its name in the interface's description, such as `clear_fault`. */
export const actText = (act: string) =>
  act.replace(/^put_/, "change_").replace("asset", "rig").replaceAll("_", " ");

/** Returns the target of an operation; `tokenName` names a token by its id. */
export function auditTarget(
  { act, target }: { act: string; target: string },
  tokenName: (id: string) => string | undefined,
): AuditTarget {
  if (!target.startsWith(BASE)) return { text: target };
  const [list = "", id = "", ...rest] = target.slice(BASE.length).split("/").map(decodeURIComponent);
  const kind = KINDS[list];
  if (!kind || !id) return { text: [list, id, ...rest].filter(Boolean).join("/") };
  const name = (kind === "token" && tokenName(id)) || id;
  const text = `${kind} ${name}${rest.length ? `: ${rest.join("/")}` : ""}`;
  if (GONE.includes(act) || kind === "token") return { text };
  return { text, path: kind === "rig" ? rigPath(id) : sessionPath(id) };
}
