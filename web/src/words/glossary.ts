/** The technical terms of the page, each explained in a sentence or two. */
export const GLOSSARY = {
  aging: "Counts the sessions without the fault after it has healed. At the end, its record is erased.",
  cleared: "A person has erased the record of the fault.",
  confirmed:
    "The test has failed for long enough to count as a fault. It stays on record when the test passes again, " +
    "until it heals or a person clears it.",
  counter:
    "Rises while the readings indicate a fault, and falls while they do not. The test fails at 127 and passes at −128.",
  debounce: "How long a failure must last before the test fails, so that a short disturbance is not a fault.",
  driveCycle: "A short motion in which every monitor comes to a result.",
  enabled:
    "Where the enable condition of a test holds: the rig moves enough, the ball is in view and free. " +
    "Elsewhere nothing is tested.",
  evidence:
    "The natural logarithm of how much better a broken servo explains the motion than a healthy one: " +
    "13 nats are odds of 440 000 to 1.",
  freezeFrame: "The values at the first failure of an occurrence.",
  healed: "Enough sessions without the fault have followed.",
  healing: "Counts the sessions without the fault. At the end, the fault has healed.",
  pending:
    "The test has failed, but the fault is not confirmed: the failure was too short, or the rig is not calibrated. " +
    "The interface calls this pending.",
  residual: "Measured minus predicted acceleration: what the twin does not explain.",
  state:
    "Failing: confirmed, and its test fails now. Suspected: its test fails, but the fault is not confirmed. " +
    "On record: its test passes again.",
  twin: "A model of this rig without any fault. It gets the same commands; the real ball is compared with its ball.",
} as const;

export type GlossaryTerm = keyof typeof GLOSSARY;
