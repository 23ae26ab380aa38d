import type { FaultStatus } from "../api/types";

/** The health of a rig: its worst fault, a drift warning, or samples that are missing or not judged. */
export type RigHealth = "fault" | "suspect" | "drift" | "untested" | "ok" | "silent" | "idle";

/** The state of a fault in the rig's fault memory. */
export type FaultState = { status: FaultStatus; acknowledged?: boolean };

/** The severity of a fault, 0 (not active) to 3 (confirmed, not acknowledged). */
export function severity(fault: FaultState): number {
  if (fault.status === "confirmed") return fault.acknowledged ? 2 : 3;
  return fault.status === "pending" ? 1 : 0;
}

/** The greatest severity of `faults`. */
export const worstSeverity = (faults: FaultState[]) => Math.max(0, ...faults.map(severity));

/** The health of a rig by its faults alone; undefined if none is active. */
export function healthByFaults(faults: FaultState[]): RigHealth | undefined {
  const worst = worstSeverity(faults);
  if (worst >= 2) return "fault";
  return worst === 1 ? "suspect" : undefined;
}
