/** Which calibration a report's subject was judged with, in words. */
import type { Calibration } from "../../api/types";
import { dateTime } from "../../words/time";

/**
 * Returns the sentence. `judged` is the calibration in force when the session began: null without one,
 * undefined if the session is not stored any more, and then `id` is all that is known of it.
 */
export function certificateNote(
  judged: Calibration | null | undefined,
  id: string | null | undefined,
  present: Calibration | null | undefined,
): string {
  if (judged === null || (judged === undefined && !id)) return "Judged without a calibration.";
  if (!judged) return `Judged with calibration ${id}, whose session is not stored any more.`;
  const note = `Judged with calibration ${judged.id}, of ${dateTime(judged.made_at)}`;
  return judged.id === present?.id ? `${note}.` : `${note}, which is not the present one of the rig.`;
}
