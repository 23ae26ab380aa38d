import type { Asset } from "../../api/types";
import type { SetUpStep } from "../../router/paths";

export const STEPS: { key: SetUpStep; word: string; isDone?: (asset?: Asset) => boolean }[] = [
  { key: "describe", word: "Describe", isDone: (asset) => asset !== undefined },
  { key: "connect", word: "Connect" },
  { key: "check", word: "Check" },
  { key: "learn", word: "Learn", isDone: (asset) => asset?.calibration != null },
];

interface Props {
  current: SetUpStep;
  /** The registered rig; missing if it is new. */
  asset?: Asset;
  /** Missing before the rig is registered: the other steps need it. */
  goTo?: (step: SetUpStep) => void;
}

export function Steps({ current, asset, goTo }: Props) {
  return (
    <ol class="steps" aria-label="Steps">
      {STEPS.map(({ key, word, isDone }, i) => (
        <li aria-current={key === current ? "step" : undefined}>
          {goTo ? (
            <button type="button" class="link" onClick={() => goTo(key)}>
              {i + 1}. {word}
              {isDone?.(asset) && <span class="status-ok"> ✓</span>}
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
