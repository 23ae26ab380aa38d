import type { FaultStatus } from "../api/types";

/**
 * The health of a rig: its worst fault, a drift warning, or samples that are missing or not judged.
 * `unlearnt`: only sensor faults can be confirmed, so that "no fault" has no ground.
 * `recorded`: the test of a fault on record passes again. `unknown`: the page has lost the connection.
 */
export type RigHealth =
  "fault" | "suspect" | "recorded" | "drift" | "untested" | "unlearnt" | "ok" | "silent" | "idle" | "unknown";

/** The state of a fault in the rig's fault memory. */
export interface FaultState {
  status: FaultStatus;
  /** Whether the last result of its test is a failure. */
  failing: boolean;
  /** Whether this result is one of the last session that was opened, not of one before. */
  tested: boolean;
  acknowledged?: boolean;
}

/** Whether a fault is confirmed and fails, is pending and fails, is on record but passes, or none of these. */
export type Standing = "failing" | "pending" | "recorded" | "none";

export function standing({ status, failing }: FaultState): Standing {
  if (status !== "confirmed" && status !== "pending") return "none";
  if (!failing) return "recorded";
  return status === "confirmed" ? "failing" : "pending";
}

const RANK: Record<Standing, number> = { failing: 6, pending: 4, recorded: 2, none: 0 };

/** The severity of a fault: 0 if it is not active, greater if it fails now, is confirmed, and is not acknowledged. */
export function severity(fault: FaultState): number {
  const rank = RANK[standing(fault)];
  return rank && fault.acknowledged ? rank - 1 : rank;
}

/** The greatest severity of `faults`. */
export const worstSeverity = (faults: FaultState[]) => Math.max(0, ...faults.map(severity));

/** The health of a rig by its faults alone; undefined if none is active. */
export function healthByFaults(faults: FaultState[]): RigHealth | undefined {
  const worst = worstSeverity(faults);
  if (worst > RANK.pending) return "fault";
  if (worst > RANK.recorded) return "suspect";
  return worst > 0 ? "recorded" : undefined;
}
