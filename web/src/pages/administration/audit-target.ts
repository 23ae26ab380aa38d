/** What an audited operation was applied to. */
import { rigPath, sessionPath } from "../../router/paths";
import { codeTitle } from "../../words/fault-names";

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

/** The words for other targets, by the beginning of their paths; `$1` is the id. */
const OTHERS: [RegExp, string][] = [
  [/^login$/, "login"],
  [/^demo\b.*/, "the demo"],
  [/^replays\/(.+)/, "replay $1"],
  [/^notifications\/rules\/(.+)/, "notification rule $1"],
  [/^notifications\/channels\/([^/]+).*/, "notification channel $1"],
  [/^notifications\/.*/, "notifications"],
  [/^alarms\b.*/, "alarms"],
];

/** The words for what belongs to a rig or a session, by the path below it. The action is told beside it. */
const PARTS: [RegExp, string][] = [
  [/^(end|tags|acknowledge|learning)\b.*/, ""],
  [/^sessions\/import$/, "an imported session"],
  [/^calibrations$/, "a calibration"],
  [/^calibrations\/([^/]+).*/, "calibration $1"],
  [/^remarks\b.*/, "a remark"],
  [/^replays$/, "a replay"],
  [/^mutes\/([^/]+)/, "mute of $1"],
];

/** Returns `path` in the words of the first pattern that it matches, or else as it is. */
function inWords(path: string, words: [RegExp, string][]): string {
  const [pattern, text] = words.find(([pattern]) => pattern.test(path)) ?? [];
  return pattern ? path.replace(pattern, text!) : path;
}

/** What of a rig or a session an operation was applied to. */
function partOf(rest: string[]): string {
  const [list, code] = rest;
  if (list === "faults" && code) return codeTitle(code);
  return inWords(rest.join("/"), PARTS);
}

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
  if (!kind || !id) return { text: inWords([list, id, ...rest].filter(Boolean).join("/"), OTHERS) };
  const name = (kind === "token" && tokenName(id)) || id;
  const part = partOf(rest);
  const text = `${kind} ${name}${part && `: ${part}`}`;
  if (GONE.includes(act) || kind === "token") return { text };
  return { text, path: kind === "rig" ? rigPath(id) : sessionPath(id) };
}
