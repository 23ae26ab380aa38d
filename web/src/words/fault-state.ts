/** The state of a fault, and of a line about it: a class of the style sheet, and text. */
import type { FaultEntry, FaultLine } from "../api/types";
import { standing, type FaultState } from "./severity";
import { isFailing, isTested } from "./status-byte";

/** The state of a fault by its entry in the fault memory. */
export const stateOf = ({ status, status_byte, acknowledged }: FaultEntry): FaultState => ({
  status,
  acknowledged,
  failing: isFailing({ status_byte }),
  tested: isTested({ status_byte }),
});

export const chipClass = (fault: FaultState) => {
  const seen = fault.acknowledged && standing(fault) !== "none" ? " chip-acknowledged" : "";
  return `chip chip-${standing(fault)}${seen}`;
};

/** Whether data of a rig arrive: during an open session they do or have stopped; without one, none are expected. */
export type Presence = "arriving" | "silent" | "ended";

/** Whether data arrive, by what the service tells with a fault or an alarm. */
export function presenceOf(rig: {
  session_open?: boolean | null;
  communication_lost_since?: string | null;
}): Presence {
  if (!rig.session_open) return "ended";
  return rig.communication_lost_since ? "silent" : "arriving";
}

/**
 * Whether the result of a test is one of now: data arrive, and the test has had a result in their session. Otherwise
 * it is an earlier one.
 */
export const isPresent = ({ tested }: Pick<FaultState, "tested">, presence: Presence) =>
  presence === "arriving" && tested;

/** The word for a status of a fault. */
export const statusWord = <T extends string>(status: T) => (status === "pending" ? "suspected" : status);

/** A fault whose test passes again: what it was, with the time at which its test began to fail, if that is known. */
function recordedText({ status }: FaultState, since?: string): string {
  const was = since
    ? `${status === "pending" ? "suspected" : "failed"} ${since}`
    : `was ${statusWord(status)}`;
  return `${was}, passes again`;
}

/** A test that fails, or failed at the end: `now` or `past`, and since when. */
function failureText(now: string, past: string, isNow: boolean, since?: string): string {
  if (isNow) return since ? `${now} since ${since}` : now;
  // The time comes first: without room, the end is cut.
  return since ? `${past} ${since}, when last tested` : `${past} when last tested`;
}

/** Returns the state of a fault as text. `since` says when its test began to fail. */
export function stateText(fault: FaultState, presence: Presence = "arriving", since?: string): string {
  const isNow = isPresent(fault, presence);
  const silence = presence === "silent" ? "; now silent" : "";
  const text = {
    failing: failureText("failing", "failed", isNow, since) + silence,
    pending: failureText("suspected", "suspected", isNow, since) + silence,
    recorded: recordedText(fault, since),
    none: fault.status,
  }[standing(fault)];
  return fault.acknowledged && standing(fault) !== "none" ? `${text}, acknowledged` : text;
}

/** Whether a line reports that the test of a fault on record passes again. */
export const isRepair = (line: Pick<FaultLine, "status" | "status_byte">) =>
  !isFailing(line) && (line.status === "pending" || line.status === "confirmed");

/** What a line reports, as text and as a class of the style sheet. */
export function changeOf(line: Pick<FaultLine, "status" | "status_byte">): { text: string; look: string } {
  if (isRepair(line)) return { text: "passes again", look: "status-passed" };
  return { text: statusWord(line.status), look: `status-${line.status}` };
}

/** What a test that passes again does not prove: a small offset that lasts becomes the level of its session. */
export const repairNote = ({ kind }: Pick<FaultEntry, "kind">) =>
  kind === "offset"
    ? "A small offset that lasts may be taken for the level of the plate, so that its test passes without a repair: " +
      "check the servo before you clear the fault."
    : "";
