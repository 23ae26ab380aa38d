import type { MappedColumn } from "./mapping";
import { ROLE_WORDS, UNITS, type Role } from "./roles";
import { SignChoice } from "./sign-choice";
import type { Table } from "./table";

/** Values of the column that are shown. */
const SHOWN = 4;

interface Props {
  role: Role;
  column: MappedColumn;
  table: Table;
  set: (part: Partial<MappedColumn>) => void;
}

/** The column of the file that has a role. */
export function MappingRow({ role, column: { index, factor, sign }, table, set }: Props) {
  const word = ROLE_WORDS[role];
  const firstRows = table.rows.slice(0, SHOWN);
  const chooseColumn = (value: string) => set({ index: value === "" ? null : Number(value) });
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
          {UNITS[role].map((unit) => (
            <option value={unit.factor}>{unit.word}</option>
          ))}
        </select>
      </td>
      <td>{role !== "t_s" && <SignChoice word={word} sign={sign} choose={(sign) => set({ sign })} />}</td>
      <td class="quiet clip">
        {index === null ? "" : firstRows.map((row) => row[index] || "empty").join(", ")}
      </td>
    </tr>
  );
}
