import { guessFactor, type MappedColumn } from "./mapping";
import { QUANTITY_TITLES, UNITS, type Quantity } from "./quantities";
import { SignChoice } from "./sign-choice";
import type { Table } from "./table";

/** Number of displayed values. */
const SHOWN = 4;

interface Props {
  quantity: Quantity;
  column: MappedColumn;
  table: Table;
  set: (part: Partial<MappedColumn>) => void;
}

/** The column, unit and sign of a quantity. */
export function MappingRow({ quantity, column: { index, factor, sign }, table, set }: Props) {
  const word = QUANTITY_TITLES[quantity];
  const firstRows = table.rows.slice(0, SHOWN);
  const chooseColumn = (value: string) => {
    if (value === "") return set({ index: null });
    const chosen = Number(value);
    set({ index: chosen, factor: guessFactor(quantity, table, chosen) });
  };
  return (
    <tr>
      <th scope="row">{word}</th>
      <td>
        <select
          aria-label={`Column of ${word}`}
          value={index ?? ""}
          onChange={(e) => chooseColumn(e.currentTarget.value)}
        >
          <option value="">none</option>
          {table.header.map((name, i) => (
            <option value={i}>{name || `column ${i + 1}`}</option>
          ))}
        </select>
      </td>
      <td>
        <select
          aria-label={`Unit of ${word}`}
          value={factor}
          onChange={(e) => set({ factor: Number(e.currentTarget.value) })}
        >
          {UNITS[quantity].map((unit) => (
            <option value={unit.factor}>{unit.word}</option>
          ))}
        </select>
      </td>
      <td>{quantity !== "t_s" && <SignChoice word={word} sign={sign} choose={(sign) => set({ sign })} />}</td>
      <td class="quiet clip">
        {index === null ? "" : firstRows.map((row) => row[index] || "empty").join(", ")}
      </td>
    </tr>
  );
}
