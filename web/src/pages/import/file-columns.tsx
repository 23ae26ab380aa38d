import type { FileColumn } from "../../api/types";

interface Props {
  columns: FileColumn[];
  /** Whether they are shown at first. */
  isOpen: boolean;
}

/** The columns of the file, with their first values. */
export function FileColumns({ columns, isOpen }: Props) {
  return (
    <details open={isOpen}>
      <summary>Columns of the file</summary>
      <div class="scroll">
        <table>
          <thead>
            <tr>
              <th>Column</th>
              <th>Unit</th>
              <th>First values</th>
            </tr>
          </thead>
          <tbody>
            {columns.map(({ number, name, unit, values }) => (
              <tr>
                <th scope="row">{name || `column ${number}`}</th>
                <td>{unit ?? ""}</td>
                <td class="quiet">{values.join(", ")}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}
