/** Words about background jobs. */
import type { CalibrationJob } from "../api/types";
import { plural } from "./numbers";

/** Why a job waits, or otherwise what it does: `doing`. */
export function jobText({ waits }: Pick<CalibrationJob, "waits">, doing: string): string {
  if (waits?.reason === "samples") return "Waiting until fewer samples are queued…";
  if (waits?.n_before) return `Waiting for ${plural(waits.n_before, "other job")}…`;
  return `${doing}…`;
}
