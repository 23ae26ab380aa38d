/** Problems of the service in words for people: their details name the requests of programs. */
import type { Problem } from "../api/types";

const PREFIX = "urn:offbd:problem:";

const WORDS: Record<string, string> = {
  "asset-exists":
    "There is a rig of this name already. Choose another name, or open that rig and change it in its set-up.",
  changed:
    "Somebody has changed this since the page showed it, so nothing was saved. Reload the page to see the change, " +
    "then make yours again.",
  "unknown-asset": "There is no rig of this name. Register it under Set up first.",
  "nothing-offered":
    "No calibration waits for an answer. It was answered before, or the rig must move more first.",
  "already-learnt":
    "This rig is calibrated already. Calibrate it again from sessions that you choose in its set-up, or restore " +
    "an earlier calibration.",
};

const DELETED = "Somebody has deleted this since the page showed it, so nothing was saved.";

/** Returns the words for a problem whose detail is for programs; undefined if its detail is for people. */
export function problemWords({ type, etag }: Partial<Problem>): string | undefined {
  if (type === `${PREFIX}changed` && !etag) return DELETED;
  return type?.startsWith(PREFIX) ? WORDS[type.slice(PREFIX.length)] : undefined;
}
