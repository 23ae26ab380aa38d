/** How a rig stands, as one word for its worst fault, warning, or silence. */
export type RigHealth = "fault" | "suspect" | "drift" | "ok" | "silent" | "idle";

/** How a fault stands in the rig's fault memory. */
export type FaultStanding = { status: string; acknowledged?: boolean };

/** How bad a fault is: the higher, the worse; 0 where it is not active. */
export function severity(fault: FaultStanding): number {
  if (fault.status === "confirmed") return fault.acknowledged ? 2 : 3;
  return fault.status === "pending" ? 1 : 0;
}

/** How bad the worst of `faults` is. */
export const worstSeverity = (faults: FaultStanding[]) => Math.max(0, ...faults.map(severity));

/** What a rig's faults alone say of its health; nothing where none is active. */
export function healthByFaults(faults: FaultStanding[]): RigHealth | undefined {
  const worst = worstSeverity(faults);
  if (worst >= 2) return "fault";
  return worst === 1 ? "suspect" : undefined;
}
