import type { FaultEntry, State } from "../../api/types";
import { healthByFaults, severity, type RigHealth } from "../../words/severity";

export const activeFaults = (faults: FaultEntry[]) =>
  faults.filter((fault) => severity(fault) > 0).sort((a, b) => severity(b) - severity(a));

export function healthOf(faults: FaultEntry[], state: State | undefined, isSilent: boolean): RigHealth {
  const muted = (state?.monitors ?? []).filter((monitor) => monitor.muted).map((monitor) => monitor.code);
  const byFaults = healthByFaults(faults.filter((fault) => !muted.includes(fault.code)));
  if (byFaults) return byFaults;
  if (!state?.session_id) return "idle";
  if (isSilent) return "silent";
  return state.unjudged || muted.length ? "untested" : "ok";
}
