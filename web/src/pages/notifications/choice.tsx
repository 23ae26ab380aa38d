interface Props<T extends string | number> {
  word: string;
  value: T;
  /** Values and their words. */
  options: readonly (readonly [T, string])[];
  change: (value: string) => void;
}

/** One of several values. */
export function Choice<T extends string | number>({ word, value, options, change }: Props<T>) {
  return (
    <label>
      {word}
      <select value={value} onChange={(e) => change(e.currentTarget.value)}>
        {options.map(([value, name]) => (
          <option value={value}>{name}</option>
        ))}
      </select>
    </label>
  );
}
