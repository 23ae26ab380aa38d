import { MappingRow } from "./mapping-row";
import type { MappedColumn, Mapping } from "./mapping";
import { QUANTITIES, type Quantity } from "./quantities";
import type { Table } from "./table";

interface Props {
  table: Table;
  mapping: Mapping;
  change: (mapping: Mapping) => void;
}

/** The table that assigns a column, a unit and a sign to each quantity. */
export function ColumnMapping({ table, mapping, change }: Props) {
  const set = (quantity: Quantity, part: Partial<MappedColumn>) =>
    change({ ...mapping, [quantity]: { ...mapping[quantity], ...part } });
  return (
    <div class="scroll">
      <table class="mapping">
        <thead>
          <tr>
            <th>Quantity</th>
            <th>Column</th>
            <th>Unit</th>
            <th>Sign</th>
            <th>First values</th>
          </tr>
        </thead>
        <tbody>
          {QUANTITIES.map((quantity) => (
            <MappingRow
              quantity={quantity}
              column={mapping[quantity]}
              table={table}
              set={(part) => set(quantity, part)}
            />
          ))}
        </tbody>
      </table>
    </div>
  );
}
