import type { State } from "../../api/types";
import { count, millimetres, seconds } from "../../words/numbers";

/** Describes the last judged sample. */
function lastSample({ t_s, evidence }: State): string {
  if (t_s == null) return "; they are judged when later samples arrive.";
  const ball = `${millimetres(evidence.x.position_m)}, ${millimetres(evidence.y.position_m)}`;
  return `, the last at ${seconds(t_s)} on the device's clock: ball at ${ball}.`;
}

/** Whether samples arrive; `state` is missing before the first one. */
export function SamplesStatus({ state, isSending }: { state?: State; isSending: boolean }) {
  if (!state)
    return (
      <div class="wait" role="status">
        <span class="spinner" aria-hidden="true" /> Waiting for the first sample…
      </div>
    );
  return (
    <div class="wait wait-good" role="status">
      <b>{isSending ? "Receiving samples." : "Samples received."}</b> {count(state.samples)} in session{" "}
      <b>{state.session}</b>
      {lastSample(state)}
    </div>
  );
}
