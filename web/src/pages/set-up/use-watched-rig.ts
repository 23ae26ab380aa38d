import { useNow } from "../../hooks/use-now";
import { useRigStream } from "../../hooks/use-rig-stream";

const STATES_PER_SECOND = 10;

/** Time without a sample after which a device counts as not sending, ms. */
const SILENT_MS = 5000;

/** The rig's stream, for the steps that show live data. */
export function useWatchedRig(name: string) {
  const { state, buffer, isSilent } = useRigStream(name, { statesPerSecond: STATES_PER_SECOND });
  const now = useNow(1000);
  return { state, buffer, isSending: !isSilent(now, SILENT_MS) };
}
