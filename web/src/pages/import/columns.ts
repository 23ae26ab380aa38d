/** The columns of a recording in the units of the service, and its session file. */
import type { Mapping } from "./mapping";
import { QUANTITIES, type Quantity } from "./quantities";
import { numbersOf, type Table } from "./table";

export type Columns = Record<Quantity, (number | null)[]>;

/** Significant digits of a value: more than any sensor has, without binary rounding noise. */
const DIGITS = 12;

export function toColumns(table: Table, mapping: Mapping): Columns {
  const column = (quantity: Quantity) => {
    const { index, factor, sign } = mapping[quantity];
    if (index === null) return table.rows.map(() => null);
    return numbersOf(table, index).map((value) => (value === null ? null : value * factor * sign));
  };
  return Object.fromEntries(QUANTITIES.map((quantity) => [quantity, column(quantity)])) as Columns;
}

const cell = (value: number | null | undefined) =>
  value == null ? "" : `${Number(value.toPrecision(DIGITS))}`;

/** Returns the session file; numbers and column names need no quotes. */
export function toCsv(columns: Columns): string {
  const rows = columns.t_s.flatMap((t, i) =>
    t === null ? [] : [QUANTITIES.map((quantity) => cell(columns[quantity][i])).join(",")],
  );
  return `${QUANTITIES.join(",")}\n${rows.join("\n")}\n`;
}

export const finite = (column: (number | null)[]) => column.filter((value) => value !== null);

/** Returns the smallest and the largest of `values`, which may be too many for the arguments of Math.min. */
export function extent(values: number[]): [low: number, high: number] {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return [low, high];
}

/** Counts the rows that have a time and a position. */
export const countSeen = ({ t_s, x_m, y_m }: Columns) =>
  t_s.filter((t, i) => t !== null && x_m[i] !== null && y_m[i] !== null).length;
