/** The bits of the ISO 14229-1 status byte (annex D.2), from bit 7 down to bit 0. */
export const STATUS_BITS = [
  {
    bit: 7,
    name: "warningIndicatorRequested",
    on: "A warning lamp is requested.",
    off: "No warning lamp is requested.",
  },
  {
    bit: 6,
    name: "testNotCompletedThisOperationCycle",
    on: "The test has not completed in this session.",
    off: "The test has completed in this session.",
  },
  {
    bit: 5,
    name: "testFailedSinceLastClear",
    on: "The test has failed since the fault was last cleared.",
    off: "The test has not failed since the fault was last cleared.",
  },
  {
    bit: 4,
    name: "testNotCompletedSinceLastClear",
    on: "The test has not completed since the fault was last cleared.",
    off: "The test has completed since the fault was last cleared.",
  },
  {
    bit: 3,
    name: "confirmedDTC",
    on: "Confirmed: it failed often enough to be stored as a fault.",
    off: "Not confirmed.",
  },
  {
    bit: 2,
    name: "pendingDTC",
    on: "Suspected: it failed in this session or the previous one.",
    off: "Not suspected.",
  },
  {
    bit: 1,
    name: "testFailedThisOperationCycle",
    on: "The test has failed in this session.",
    off: "The test has not failed in this session.",
  },
  {
    bit: 0,
    name: "testFailed",
    on: "The test failed when it last gave a result.",
    off: "The test did not fail when it last gave a result.",
  },
] as const;

/** Bits that say no more than that a test has not run yet. */
const NEUTRAL_BITS = [6, 4];

/** Whether a bit tells nothing bad if it is set. */
export const isNeutralBit = (bit: number) => NEUTRAL_BITS.includes(bit);

/** Whether the test has given a result in the session of a fault line, or in the last one that was opened. */
export const isTested = (line: { status_byte: string }) => (parseInt(line.status_byte, 16) & 64) === 0;

/** Whether the test of a fault line fails; false for a line that reports a test that passes again. */
export const isFailing = (line: { status_byte: string }) => (parseInt(line.status_byte, 16) & 1) === 1;
