import type { OptionalField } from "./description";
import type { FieldsProps } from "./number-input";

interface Props extends FieldsProps {
  field: OptionalField;
  label: string;
  min: number;
  max: number;
  /** What the number does. */
  children: string;
}

/** Shows a field that is refused: hidden, it could not tell what is wrong. */
const show = ({ currentTarget }: { currentTarget: HTMLInputElement }) => {
  const details = currentTarget.closest("details");
  if (details) details.open = true;
};

/** An input for a number that may be left empty, and what it does. */
export function OptionalNumber({ description, set, field, label, min, max, children }: Props) {
  const value = description[field];
  return (
    <div>
      <label>
        {label}{" "}
        <input
          type="number"
          step="any"
          min={min}
          max={max}
          value={Number.isNaN(value) ? "" : value}
          aria-describedby={`${field}-help`}
          onInput={(e) => set({ [field]: e.currentTarget.valueAsNumber })}
          onInvalid={show}
        />
      </label>
      <p id={`${field}-help`} class="quiet small-text">
        {children}
      </p>
    </div>
  );
}
