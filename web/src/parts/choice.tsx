interface Props<T extends string | number> {
  label: string;
  value: T;
  /** Values and their words. */
  options: readonly (readonly [T, string])[];
  change: (value: T) => void;
  /** Whether the label is beside the values instead of above. */
  isInline?: boolean;
}

/** Selects one of several values. */
export function Choice<T extends string | number>({ label, value, options, change, isInline }: Props<T>) {
  return (
    <label class={isInline ? "inline" : undefined}>
      {label}{" "}
      <select value={value} onChange={(e) => change(options[e.currentTarget.selectedIndex]![0])}>
        {options.map(([value, word]) => (
          <option value={value}>{word}</option>
        ))}
      </select>
    </label>
  );
}
