/** Which calibration a report's subject was judged with, in words. */
import type { Asset } from "../../api/types";
import { dateTime } from "../../words/time";

/** The calibration by its id (null: none), or by the time at which the session was opened. */
export type JudgedWith = { calibration: string | null } | { opened: string };

/** Returns the sentence, and whether the certificate of the present calibration belongs to the subject. */
export function certificateNote(
  present: Asset["calibration"],
  judged: JudgedWith,
): { text: string; applies: boolean } {
  if ("calibration" in judged) {
    if (!judged.calibration) return { text: "Judged without a calibration.", applies: false };
    if (judged.calibration === present?.id)
      return {
        text: `Judged with calibration ${present.id}, of ${dateTime(present.made_at)}.`,
        applies: true,
      };
    return {
      text: `Judged with calibration ${judged.calibration}, which is not the present one of the rig.`,
      applies: false,
    };
  }
  if (!present) return { text: "The rig has no calibration.", applies: false };
  const made = `The present calibration of the rig, ${present.id}, was made ${dateTime(present.made_at)}`;
  if (Date.parse(present.made_at) > Date.parse(judged.opened))
    return { text: `${made}, after this session was opened: it was judged without it.`, applies: false };
  return { text: `${made}, before this session was opened.`, applies: true };
}
