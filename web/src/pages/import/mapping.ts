/** Guesses the column and unit of each quantity from the column names and the size of the values. */
import { QUANTITIES, UNITS, type Quantity, type Unit } from "./quantities";
import { numbersOf, type Table } from "./table";

export interface MappedColumn {
  /** Index of the column; null if the quantity is not assigned. */
  index: number | null;
  factor: number;
  sign: 1 | -1;
}

export type Mapping = Record<Quantity, MappedColumn>;

/** Patterns of column names for each quantity, the most specific first. */
const NAMES: Record<Quantity, RegExp[]> = {
  t_s: [/^t_s$/i, /^(t|time|timestamp|zeit)([_ ([].*)?$/i, /time|stamp|seconds|millis/i],
  cmd_qx_rad: [/^cmd_qx_rad$/i, /qx|cmd.*x$|tilt.*x|alpha|roll|servo.*y/i],
  cmd_qy_rad: [/^cmd_qy_rad$/i, /qy|cmd.*y$|tilt.*y|beta|pitch|servo.*x/i],
  x_m: [/^x_m$/i, /^(ball|pos|meas)?[_ ]?x([_ ([]+(m|mm|cm|in|px).*)?$/i, /(ball|pos).*x/i],
  y_m: [/^y_m$/i, /^(ball|pos|meas)?[_ ]?y([_ ([]+(m|mm|cm|in|px).*)?$/i, /(ball|pos).*y/i],
};

const UNIT_SUFFIX = /(?:[_ ([])(s|ms|us|µs|rad|mrad|deg|°|m|mm|cm|in)[)\]]?$/;

/** Returns the unit at the end of a column name. */
function unitByName(quantity: Quantity, name: string): Unit | undefined {
  const suffix = UNIT_SUFFIX.exec(name.toLowerCase())?.[1];
  const word = { deg: "°", us: "µs" }[suffix ?? ""] ?? suffix;
  return UNITS[quantity].find((unit) => unit.word === word);
}

/** Number of rows that are examined for the largest value, and for the median time step. */
const EXAMINED_ROWS = 5000;
const EXAMINED_STEPS = 200;

const median = (values: number[]) => [...values].sort((a, b) => a - b)[values.length >> 1] ?? 0;

/** Returns the unit that the size of the values suggests. */
function unitBySize(quantity: Quantity, column: (number | null)[]): Unit {
  const values = column.slice(0, EXAMINED_ROWS).filter((value) => value !== null);
  const units = UNITS[quantity];
  if (quantity === "t_s") {
    const step = median(values.slice(1, EXAMINED_STEPS).map((value, i) => value - values[i]!));
    return units[step > 2000 ? 2 : step > 1.5 ? 1 : 0]!;
  }
  const largest = values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  const largestInFirstUnit = quantity === "x_m" || quantity === "y_m" ? 2 : 1.6;
  return units[largest > largestInFirstUnit ? 1 : 0]!;
}

/** Returns the factor of the unit of a column, by its name or the size of its values. */
export function guessFactor(quantity: Quantity, table: Table, index: number): number {
  const unit = unitByName(quantity, table.header[index]!) ?? unitBySize(quantity, numbersOf(table, index));
  return unit.factor;
}

export function guessMapping(table: Table): Mapping {
  const taken = new Set<number>();
  const find = (pattern: RegExp) => table.header.findIndex((name, i) => !taken.has(i) && pattern.test(name));
  const guessColumn = (quantity: Quantity): MappedColumn => {
    const index = NAMES[quantity].map(find).find((i) => i >= 0) ?? null;
    if (index === null) return { index, factor: UNITS[quantity][0]!.factor, sign: 1 };
    taken.add(index);
    return { index, factor: guessFactor(quantity, table, index), sign: 1 };
  };
  return Object.fromEntries(QUANTITIES.map((quantity) => [quantity, guessColumn(quantity)])) as Mapping;
}
