import type { FaultEntry } from "../../api/types";

/** Whether the fault is pending or confirmed. */
export const isActive = ({ status }: FaultEntry) => status === "pending" || status === "confirmed";
