import { MappingRow } from "./mapping-row";
import type { MappedColumn, Mapping } from "./mapping";
import { ROLES, type Role } from "./roles";
import type { Table } from "./table";

interface Props {
  table: Table;
  mapping: Mapping;
  change: (mapping: Mapping) => void;
}

/** Which column of the file is what, in which unit, which way round. */
export function ColumnMapping({ table, mapping, change }: Props) {
  const set = (role: Role, part: Partial<MappedColumn>) =>
    change({ ...mapping, [role]: { ...mapping[role], ...part } });
  return (
    <div class="scroll">
      <table class="mapping">
        <thead>
          <tr>
            <th>Is</th>
            <th>Column</th>
            <th>Unit</th>
            <th>Sign</th>
            <th>First values</th>
          </tr>
        </thead>
        <tbody>
          {ROLES.map((role) => (
            <MappingRow role={role} column={mapping[role]} table={table} set={(part) => set(role, part)} />
          ))}
        </tbody>
      </table>
    </div>
  );
}
