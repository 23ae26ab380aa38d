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

/**
 * Whether the result of a test is one of now: there is an open session, and the test has had a result in it. Otherwise
 * it is that of an earlier session.
 */
export const isPresent = ({ tested }: FaultState, hasSession: boolean) => hasSession && tested;

/** Returns the state of a fault as text; `hasSession` says whether a session is open. */
export function stateText(fault: FaultState, hasSession = true): string {
  const isNow = isPresent(fault, hasSession);
  const failing = isNow ? "failing now" : "failed when last tested";
  const text = {
    failing,
    pending: isNow ? "failing, not yet confirmed" : "failed, not yet confirmed",
    recorded: `on record${fault.status === "pending" ? " as pending" : ""}, passes again`,
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
  return { text: line.status, look: `status-${line.status}` };
}
