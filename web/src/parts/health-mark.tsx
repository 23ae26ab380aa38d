import type { RigHealth } from "../words/severity";

const MARKS: Record<RigHealth, { symbol: string; word: string }> = {
  fault: { symbol: "▲", word: "fault" },
  suspect: { symbol: "◆", word: "suspected" },
  drift: { symbol: "◇", word: "drifting" },
  ok: { symbol: "●", word: "no fault" },
  silent: { symbol: "○", word: "silent" },
  idle: { symbol: "○", word: "no session" },
};

/** Colour, shape and word together: none of them alone carries the meaning. */
export function HealthMark({ health }: { health: RigHealth }) {
  const { symbol, word } = MARKS[health];
  return (
    <span class={`health health-${health}`}>
      <span aria-hidden="true">{symbol}</span>
      <span>{word}</span>
    </span>
  );
}
