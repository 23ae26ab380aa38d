import { api } from "../../api/client";
import { isFinished, poll } from "../../api/poll";
import type { CalibrationJob, Session } from "../../api/types";

/**
 * Calibrates a rig from the sessions with `ids` and activates the calibration. Sessions among them
 * that are open are ended first. Calls `show` with every state of the job; returns whether the
 * calibration succeeded.
 */
export async function learnFrom(
  asset: string,
  ids: string[],
  sessions: Session[],
  show: (job: CalibrationJob) => void,
): Promise<boolean> {
  const open = sessions.filter(({ id, state }) => ids.includes(id) && state === "open");
  for (const { id } of open) await api.endSession(id);
  const begun = await api.calibrate(asset, ids);
  show(begun);
  const finished = await poll(() => api.calibration(asset, begun.id), isFinished, show);
  if (finished.state !== "done") return false;
  show(await api.activate(asset, finished.id));
  return true;
}
