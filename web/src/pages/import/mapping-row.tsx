import type { FileColumn, FileQuantity } from "../../api/types";
import { LEFT_OUT, plainText, simpleExpression, written, type SimpleExpression } from "./mapping";
import { QUANTITY_TITLES, UNITS, type Quantity } from "./quantities";
import { rangeText } from "./range-text";
import { UnitAndSign } from "./unit-and-sign";

interface Props {
  name: Quantity;
  found: FileQuantity;
  columns: FileColumn[];
  change: (expression: string) => void;
}

/** The column, unit and sign of a quantity, or the expression that gives it. */
export function MappingRow({ name, found, columns, change }: Props) {
  const { expression, reason } = found;
  const word = QUANTITY_TITLES[name];
  const isAbsent = expression == null || expression === LEFT_OUT;
  const simple = isAbsent ? undefined : simpleExpression(expression, name, columns);
  const part = { column: "", unit: UNITS[name][0]!.written, sign: "" as const, ...simple };
  const set = (changed: Partial<SimpleExpression>) => change(written({ ...part, ...changed }));
  const choose = (column: string) => (column === LEFT_OUT ? change(LEFT_OUT) : set({ column }));
  return (
    <tr>
      <th scope="row">{word}</th>
      <td>
        <select
          aria-label={`Column of ${word}`}
          value={simple ? part.column : isAbsent ? LEFT_OUT : ""}
          onChange={(e) => choose(e.currentTarget.value)}
        >
          <option value={LEFT_OUT}>none</option>
          {!simple && !isAbsent && <option value="">an expression</option>}
          {columns.map(({ number, name: title, written: column }) => (
            <option value={column}>{title || `column ${number}`}</option>
          ))}
        </select>
      </td>
      {simple || isAbsent ? (
        <UnitAndSign name={name} part={part} isDisabled={isAbsent} set={set} />
      ) : (
        <td colSpan={2}>
          <code>{expression}</code>
        </td>
      )}
      <td class="quiet">{rangeText(name, found)}</td>
      <td class="quiet">{plainText(reason ?? "")}</td>
    </tr>
  );
}
