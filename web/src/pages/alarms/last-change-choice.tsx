/** Ranges of the last change, hours back. */
const RANGES = [
  ["", "At any time"],
  ["1", "In the last hour"],
  ["24", "In the last day"],
  ["168", "In the last week"],
] as const;

/** Selects alarms by their last change. */
export function LastChangeChoice({ hours, change }: { hours: string; change: (hours: string) => void }) {
  return (
    <label>
      Last change
      <select value={hours} onChange={(e) => change(e.currentTarget.value)}>
        {RANGES.map(([hours, word]) => (
          <option value={hours}>{word}</option>
        ))}
      </select>
    </label>
  );
}
