interface Props<T extends string> {
  legend: string;
  options: readonly T[];
  word: (option: T) => string;
  chosen: T[];
  change: (chosen: T[]) => void;
}

/** Returns `list` with `item` added or, if it is there, removed. */
const toggled = <T,>(list: T[], item: T) =>
  list.includes(item) ? list.filter((other) => other !== item) : [...list, item];

/** Check boxes for any number of values. */
export function CheckGroup<T extends string>({ legend, options, word, chosen, change }: Props<T>) {
  return (
    <fieldset>
      <legend>{legend}</legend>
      <div class="choices">
        {options.map((option) => (
          <label class="check">
            <input
              type="checkbox"
              checked={chosen.includes(option)}
              onChange={() => change(toggled(chosen, option))}
            />
            {word(option)}
          </label>
        ))}
      </div>
    </fieldset>
  );
}
