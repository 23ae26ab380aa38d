/** Ranges of the last change, hours back. */
const RANGES = [
  [0, "At any time"],
  [1, "In the last hour"],
  [24, "In the last day"],
  [168, "In the last week"],
] as const;

/** The range is rounded to minutes, so that the filter stays the same for a while. */
function since(hours: number): string | undefined {
  if (!hours) return undefined;
  const minute = 60_000;
  return new Date(Math.floor(Date.now() / minute) * minute - hours * 3_600_000).toISOString();
}

/** Selects alarms by their last change; `change` is given the start of the range. */
export function LastChangeChoice({ change }: { change: (from?: string) => void }) {
  return (
    <label>
      Last change
      <select onChange={(e) => change(since(Number(e.currentTarget.value)))}>
        {RANGES.map(([hours, word]) => (
          <option value={hours}>{word}</option>
        ))}
      </select>
    </label>
  );
}
