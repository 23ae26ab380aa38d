import type { SetUpStep } from "../../router/paths";

const STEPS: { key: SetUpStep; word: string }[] = [
  { key: "describe", word: "Describe" },
  { key: "connect", word: "Connect" },
  { key: "check", word: "Check" },
  { key: "learn", word: "Learn" },
];

interface Props {
  current: SetUpStep;
  /** Missing before the rig is registered: the other steps need it. */
  goTo?: (step: SetUpStep) => void;
}

export function Steps({ current, goTo }: Props) {
  return (
    <ol class="steps" aria-label="Steps">
      {STEPS.map(({ key, word }, i) => (
        <li aria-current={key === current ? "step" : undefined}>
          {goTo ? (
            <button type="button" class="link" onClick={() => goTo(key)}>
              {i + 1}. {word}
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
