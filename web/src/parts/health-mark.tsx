import type { RigHealth } from "../words/severity";

const MARKS: Record<RigHealth, { symbol: string; word: string }> = {
  fault: { symbol: "▲", word: "fault" },
  suspect: { symbol: "◆", word: "suspected" },
  recorded: { symbol: "△", word: "on record" },
  drift: { symbol: "◇", word: "drifting" },
  untested: { symbol: "◌", word: "not tested" },
  unlearnt: { symbol: "◌", word: "not calibrated" },
  ok: { symbol: "●", word: "no fault" },
  silent: { symbol: "○", word: "no data" },
  unknown: { symbol: "○", word: "not known" },
  idle: { symbol: "○", word: "no session" },
};

/** The health of a rig by colour, shape and word; the meaning does not depend on colour alone. */
export function HealthMark({ health }: { health: RigHealth }) {
  const { symbol, word } = MARKS[health];
  return (
    <span class={`health health-${health}`}>
      <span aria-hidden="true">{symbol}</span>
      <span>{word}</span>
    </span>
  );
}
