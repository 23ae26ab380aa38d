import type { FaultLine } from "../../api/types";
import { faultTitle } from "../../words/fault-names";
import { seconds } from "../../words/numbers";
import { sentence } from "../../words/sentence";
import { isFailing } from "../../words/status-byte";
import { ambiguousCauses } from "../../words/verdict";

/** Time before the onset to which the button leads, s. */
const LEAD_S = 0.5;

/** The status of the fault, or the note that its test passes again. */
function status(line: FaultLine): { text: string; look: string } {
  const hasPassed = !isFailing(line);
  const isOver = line.status === "cleared" || line.status === "healed";
  return {
    text: hasPassed && !isOver ? "test passes again" : line.status,
    look: hasPassed ? "quiet" : `status-${line.status}`,
  };
}

/** A fault of the session, with a button that leads to its onset. */
export function FoundFault({ line, seek }: { line: FaultLine; seek: (t: number) => void }) {
  const { text, look } = status(line);
  return (
    <li>
      <button
        type="button"
        class="link n"
        onClick={() => seek((line.onset_s ?? line.t_s) - LEAD_S)}
        aria-label={`Go to ${seconds(line.t_s)}`}
      >
        {seconds(line.t_s)}
      </button>{" "}
      <span>
        <b>{ambiguousCauses(line.candidates) || faultTitle(line.code, line.kind)}</b>{" "}
        <span class={look}>{text}</span>
        <br />
        <span class="quiet">{sentence(line.summary)}</span>
      </span>
    </li>
  );
}
