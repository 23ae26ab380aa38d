import type { SimpleExpression } from "./mapping";
import { QUANTITY_TITLES, UNITS, type Quantity } from "./quantities";

interface Props {
  name: Quantity;
  part: SimpleExpression;
  isDisabled: boolean;
  set: (changed: Partial<SimpleExpression>) => void;
}

/** The unit and the sign of a column; a time has no sign. */
export function UnitAndSign({ name, part, isDisabled, set }: Props) {
  const word = QUANTITY_TITLES[name];
  return (
    <>
      <td>
        <select
          aria-label={`Unit of ${word}`}
          value={part.unit}
          disabled={isDisabled}
          onChange={(e) => set({ unit: e.currentTarget.value })}
        >
          {UNITS[name].map((unit) => (
            <option value={unit.written}>{unit.word}</option>
          ))}
        </select>
      </td>
      <td>
        {name !== "t_s" && (
          <select
            aria-label={`Sign of ${word}`}
            value={part.sign}
            disabled={isDisabled}
            onChange={(e) => set({ sign: e.currentTarget.value as "" | "-" })}
          >
            <option value="">+</option>
            <option value="-">−</option>
          </select>
        )}
      </td>
    </>
  );
}
