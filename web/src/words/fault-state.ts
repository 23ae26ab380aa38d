/** The state of a fault on its chip: a class of the style sheet, and text. */
import { severity, type FaultState } from "./severity";

export const chipClass = (fault: FaultState) =>
  `chip chip-${["none", "pending", "known", "confirmed"][severity(fault)]}`;

export const stateText = ({ status, acknowledged }: FaultState) =>
  acknowledged && status !== "cleared" ? `${status}, acknowledged` : status;
