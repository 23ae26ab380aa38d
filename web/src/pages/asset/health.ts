import type { FaultEntry, State } from "../../api/types";
import { stateOf } from "../../words/fault-state";
import { healthByFaults, severity, type RigHealth } from "../../words/severity";

const severityOf = (fault: FaultEntry) => severity(stateOf(fault));

export const activeFaults = (faults: FaultEntry[]) =>
  faults.filter((fault) => severityOf(fault) > 0).sort((a, b) => severityOf(b) - severityOf(a));

interface Known {
  /** Whether the page receives the states of the rig. */
  isConnected: boolean;
  /** Whether the page has lost the connection, so that it knows nothing of the present. */
  isLost: boolean;
  /** Whether no sample has arrived for some time, or communication with the rig is lost. */
  isSilent: boolean;
  /** Whether the rig has a calibration. */
  isLearnt: boolean;
}

export function healthOf(
  faults: FaultEntry[],
  state: State | undefined,
  { isConnected, isLost, isSilent, isLearnt }: Known,
): RigHealth {
  if (isLost) return "unknown";
  const muted = (state?.monitors ?? []).filter((monitor) => monitor.muted).map(({ code }) => code);
  const byFaults = healthByFaults(faults.filter(({ code }) => !muted.includes(code)).map(stateOf));
  if (byFaults) return byFaults;
  if (!isConnected || !state) return "unknown";
  if (!state.session_id) return "idle";
  if (isSilent) return "silent";
  if (state.unjudged || muted.length) return "untested";
  return isLearnt ? "ok" : "unlearnt";
}
