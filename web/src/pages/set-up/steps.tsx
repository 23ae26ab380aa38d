import type { Asset } from "../../api/types";
import type { SetUpStep } from "../../router/paths";
import { isDone } from "./is-done";

export const STEPS: { key: SetUpStep; word: string }[] = [
  { key: "describe", word: "Describe" },
  { key: "connect", word: "Connect" },
  { key: "check", word: "Check" },
  { key: "learn", word: "Calibrate" },
];

interface Props {
  current: SetUpStep;
  /** The registered rig; missing if it is new. */
  asset?: Asset;
  /** Whether a session of the rig has samples. */
  hasSamples: boolean;
  /** Missing before the rig is registered: the other steps need it. */
  goTo?: (step: SetUpStep) => void;
}

export function Steps({ current, asset, hasSamples, goTo }: Props) {
  return (
    <ol class="steps" aria-label="Steps">
      {STEPS.map(({ key, word }, i) => (
        <li aria-current={key === current ? "step" : undefined}>
          {goTo ? (
            <button type="button" class="link" onClick={() => goTo(key)}>
              {i + 1}. {word}
              {isDone(key, asset, hasSamples) && <span class="status-ok"> ✓</span>}
            </button>
          ) : (
            <span>
              {i + 1}. {word}
            </span>
          )}
        </li>
      ))}
    </ol>
  );
}
