import { isDefault, type Description, type NumberField } from "./description";

export interface FieldsProps {
  description: Description;
  set: (part: Partial<Description>) => void;
}

/** Smallest value of a field: all are greater than zero. */
const LEAST = 0.001;

interface Props extends FieldsProps {
  field: NumberField;
  label: string;
  unit: string;
}

/** An input for a number of the description, with its unit. */
export function NumberInput({ description, set, field, label, unit }: Props) {
  return (
    <label>
      <span>
        {label}, {unit} {isDefault(description, field) && <span class="quiet small-text">default</span>}
      </span>{" "}
      <input
        type="number"
        step="any"
        min={LEAST}
        required
        value={Number.isNaN(description[field]) ? "" : description[field]}
        onInput={(e) => set({ [field]: e.currentTarget.valueAsNumber })}
      />
    </label>
  );
}
