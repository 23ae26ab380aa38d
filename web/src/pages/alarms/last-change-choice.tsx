import { Choice } from "../../parts/choice";

/** Ranges of the last change, hours back. */
const RANGES = [
  ["", "At any time"],
  ["1", "In the last hour"],
  ["24", "In the last day"],
  ["168", "In the last week"],
] as const;

/** Selects alarms by their last change. */
export const LastChangeChoice = ({ hours, change }: { hours: string; change: (hours: string) => void }) => (
  <Choice<string> label="Last change" options={RANGES} value={hours} change={change} />
);
