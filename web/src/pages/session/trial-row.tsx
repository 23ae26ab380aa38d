import type { Thresholds, TriedMonitor } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import { NONE, number, plural, seconds } from "../../words/numbers";
import { factorAt, hasLimit, positionOf, type TriedValues } from "./trial";

/** Longest debounce of the slider, s. */
const LONGEST_S = 5;

interface Props {
  thresholds: Thresholds;
  values: TriedValues;
  set: (values: TriedValues) => void;
  /** What was found with the tried settings. */
  found?: TriedMonitor;
  /** What is found as set, while something is tried. */
  baseline?: TriedMonitor;
}

interface NumberProps {
  n?: number;
  noun: string;
  /** The number as set, to compare with. */
  asSet?: number;
}

const Found = ({ n, noun, asSet }: NumberProps) => (
  <td class="n">
    {n === undefined ? NONE : plural(n, noun)}
    {asSet !== undefined && <span class="quiet"> (as set: {asSet})</span>}
  </td>
);

/** The sliders of one monitor, and what it would find. */
export function TrialRow({ thresholds: { code, fail_s }, values, set, found, baseline }: Props) {
  const { limit, debounce_s } = values;
  const title = codeTitle(code);
  return (
    <tr>
      <th scope="row">{title}</th>
      <td>
        {hasLimit(code) ? (
          <>
            <input
              type="range"
              min={-1}
              max={3}
              step={0.02}
              value={positionOf(limit ?? 1)}
              aria-label={`Limit of ${title}`}
              aria-valuetext={`${limit ?? 1} times`}
              onInput={(e) => set({ ...values, limit: factorAt(Number(e.currentTarget.value)) })}
            />{" "}
            <span class="n">{limit === undefined ? "as set" : `× ${limit}`}</span>
          </>
        ) : (
          "–"
        )}
      </td>
      <td>
        <input
          type="range"
          min={0}
          max={LONGEST_S}
          step={0.05}
          value={debounce_s ?? fail_s}
          aria-label={`Debounce of ${title}`}
          aria-valuetext={seconds(debounce_s ?? fail_s)}
          onInput={(e) => set({ ...values, debounce_s: Number(e.currentTarget.value) })}
        />{" "}
        <span class="n">{debounce_s === undefined ? "as set" : number(debounce_s, 2, "s")}</span>
      </td>
      <Found n={found?.alarms} noun="alarm" asSet={baseline?.alarms} />
      <Found n={found?.failures} noun="failure" asSet={baseline?.failures} />
    </tr>
  );
}
