import type { FaultLine } from "../../api/types";
import { faultTitle } from "../../words/fault-names";
import { seconds } from "../../words/numbers";
import { changeOf } from "../../words/fault-state";
import { lineSentence } from "../../words/sentence";
import { ambiguousCauses } from "../../words/verdict";

/** Time before the onset to which the button leads, s. */
const LEAD_S = 0.5;

/** A fault of the session, with a button that leads to its onset if there is a playback. */
export function FoundFault({ line, seek }: { line: FaultLine; seek?: (t: number) => void }) {
  const { text, look } = changeOf(line);
  return (
    <li>
      {seek ? (
        <button
          type="button"
          class="link n"
          onClick={() => seek((line.onset_s ?? line.t_s) - LEAD_S)}
          aria-label={`Go to ${seconds(line.t_s)}`}
        >
          {seconds(line.t_s)}
        </button>
      ) : (
        <span class="n">{seconds(line.t_s)}</span>
      )}{" "}
      <span>
        <b>{ambiguousCauses(line.candidates) || faultTitle(line)}</b> <span class={look}>{text}</span>
        <br />
        <span class="quiet">{lineSentence(line)}</span>
      </span>
    </li>
  );
}
