/** How a fault stands, for its chip: a class of the style sheet, and words. */
import { severity, type FaultStanding } from "./severity";

export const chipClass = (fault: FaultStanding) =>
  `chip chip-${["none", "pending", "known", "confirmed"][severity(fault)]}`;

export const standingText = ({ status, acknowledged }: FaultStanding) =>
  acknowledged && status !== "cleared" ? `${status}, acknowledged` : status;
