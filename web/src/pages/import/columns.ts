/** The columns of a recording in the service's units, and the session file that is made of them. */
import type { Mapping } from "./mapping";
import { ROLES, type Role } from "./roles";
import { numbersOf, type Table } from "./table";

export type Columns = Record<Role, (number | null)[]>;

/** Digits that are written: more than any sensor has, without the noise of binary fractions. */
const DIGITS = 12;

export function toColumns(table: Table, mapping: Mapping): Columns {
  const column = (role: Role) => {
    const { index, factor, sign } = mapping[role];
    if (index === null) return table.rows.map(() => null);
    return numbersOf(table, index).map((value) => (value === null ? null : value * factor * sign));
  };
  return Object.fromEntries(ROLES.map((role) => [role, column(role)])) as Columns;
}

const cell = (value: number | null | undefined) =>
  value == null ? "" : `${Number(value.toPrecision(DIGITS))}`;

/** The session file that the service takes: numbers and fixed names, none of which needs quotes. */
export function toCsv(columns: Columns): string {
  const rows = columns.t_s.flatMap((t, i) =>
    t === null ? [] : [ROLES.map((role) => cell(columns[role][i])).join(",")],
  );
  return `${ROLES.join(",")}\n${rows.join("\n")}\n`;
}

export const finite = (column: (number | null)[]) => column.filter((value) => value !== null);

/** The smallest and the largest of `values`; there may be too many for the arguments of Math.min. */
export function extent(values: number[]): [low: number, high: number] {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return [low, high];
}
