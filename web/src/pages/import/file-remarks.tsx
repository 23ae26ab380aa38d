import type { FileInspection } from "../../api/types";
import { count, number, plural } from "../../words/numbers";
import { plainText, type Mapping } from "./mapping";

/** Two rates differ from this factor on. Chosen: no rig varies so much, and each unit of time does. */
const SAME_RATE = 1.5;

interface Props {
  inspection: FileInspection;
  /** The samples a second of the rig; undefined if it is not known yet. */
  rate?: number;
  change: (part: Partial<Mapping>) => void;
}

/** What is doubtful in a file, with buttons that correct it. */
export function FileRemarks({ inspection, rate, change }: Props) {
  const { remarks, runs, rejected, rejections, gaps, longest_gap_s, rate_hz } = inspection;
  const isOtherRate = rate && rate_hz && Math.max(rate / rate_hz, rate_hz / rate) > SAME_RATE;
  return (
    <ul class="sanity" aria-label="Remarks on the file">
      {remarks.map(({ text, changes }) => (
        <li class="warn">
          {plainText(text.charAt(0).toUpperCase() + text.slice(1))}{" "}
          {changes.length > 0 && (
            <button
              type="button"
              class="small"
              onClick={() =>
                change(Object.fromEntries(changes.map(({ quantity, expression }) => [quantity, expression])))
              }
            >
              Take {changes.map(({ quantity, expression }) => `${quantity} = ${expression}`).join(", ")}
            </button>
          )}
        </li>
      ))}
      {isOtherRate && (
        <li class="warn">
          The file has {number(rate_hz, 1)} rows per second, the rig sends {number(rate, 0)}: check the unit
          of the time, or the rate of the rig.
        </li>
      )}
      {runs > 1 && <li>The clock starts again: the file becomes {count(runs)} sessions.</li>}
      {gaps > 0 && (
        <li>
          {plural(gaps, "gap")} in the time, the longest of {number(longest_gap_s, 2, "s")}.
        </li>
      )}
      {rejected > 0 && (
        <li class="warn">
          {plural(rejected, "row")} will be rejected: {rejections.join("; ")}
          {rejected > rejections.length && "; …"}
        </li>
      )}
    </ul>
  );
}
