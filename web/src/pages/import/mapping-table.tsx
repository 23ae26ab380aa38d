import type { FileInspection } from "../../api/types";
import type { Mapping } from "./mapping";
import { MappingRow } from "./mapping-row";
import { QUANTITIES } from "./quantities";

interface Props {
  inspection: FileInspection;
  change: (part: Partial<Mapping>) => void;
}

/** The table that assigns a column, a unit and a sign to each quantity. */
export function MappingTable({ inspection: { columns, quantities }, change }: Props) {
  return (
    <div class="scroll">
      <table class="mapping">
        <thead>
          <tr>
            <th>Quantity</th>
            <th>Column</th>
            <th>Unit</th>
            <th>Sign</th>
            <th>Values</th>
            <th>Guessed by</th>
          </tr>
        </thead>
        <tbody>
          {QUANTITIES.map((name) => {
            const found = quantities.find(({ quantity }) => quantity === name);
            return (
              found && (
                <MappingRow
                  name={name}
                  found={found}
                  columns={columns}
                  change={(expression) => change({ [name]: expression })}
                />
              )
            );
          })}
        </tbody>
      </table>
    </div>
  );
}
