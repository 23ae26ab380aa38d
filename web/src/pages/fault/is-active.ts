import type { FaultEntry } from "../../api/types";

/** Whether the fault is there now, or may be. */
export const isActive = ({ status }: FaultEntry) => status === "pending" || status === "confirmed";
