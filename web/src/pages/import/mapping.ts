/** Which column of a table is what, in which unit: guessed from names and sizes. */
import { ROLES, UNITS, type Role, type Unit } from "./roles";
import { numbersOf, type Table } from "./table";

export interface MappedColumn {
  /** Of the table's column; null where no column has the role. */
  index: number | null;
  factor: number;
  sign: 1 | -1;
}

export type Mapping = Record<Role, MappedColumn>;

/** What the name of a column with a role looks like, the surest pattern first. */
const NAMES: Record<Role, RegExp[]> = {
  t_s: [/^t_s$/i, /^(t|time|timestamp|zeit)([_ ([].*)?$/i, /time|stamp|seconds|millis/i],
  cmd_qx_rad: [/^cmd_qx_rad$/i, /qx|cmd.*x$|tilt.*x|alpha|roll|servo.*y/i],
  cmd_qy_rad: [/^cmd_qy_rad$/i, /qy|cmd.*y$|tilt.*y|beta|pitch|servo.*x/i],
  x_m: [/^x_m$/i, /^(ball|pos|meas)?[_ ]?x([_ ([](m|mm|cm|in|px).*)?$/i, /(ball|pos).*x/i],
  y_m: [/^y_m$/i, /^(ball|pos|meas)?[_ ]?y([_ ([](m|mm|cm|in|px).*)?$/i, /(ball|pos).*y/i],
};

const UNIT_SUFFIX = /(?:[_ ([])(s|ms|us|µs|rad|mrad|deg|°|m|mm|cm|in)[)\]]?$/;

/** The unit that a column's name ends with. */
function unitByName(role: Role, name: string): Unit | undefined {
  const suffix = UNIT_SUFFIX.exec(name.toLowerCase())?.[1];
  const word = { deg: "°", us: "µs" }[suffix ?? ""] ?? suffix;
  return UNITS[role].find((unit) => unit.word === word);
}

/** Rows that are looked at for the largest value, and for the usual step. */
const LOOKED_AT = 5000;
const STEPS_LOOKED_AT = 200;

const median = (values: number[]) => [...values].sort((a, b) => a - b)[values.length >> 1] ?? 0;

/** The unit that the sizes of the numbers suggest. */
function unitBySize(role: Role, column: (number | null)[]): Unit {
  const values = column.slice(0, LOOKED_AT).filter((value) => value !== null);
  const units = UNITS[role];
  if (role === "t_s") {
    const step = median(values.slice(1, STEPS_LOOKED_AT).map((value, i) => value - values[i]!));
    return units[step > 2000 ? 2 : step > 1.5 ? 1 : 0]!;
  }
  const largest = values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  const largestInFirstUnit = role === "x_m" || role === "y_m" ? 2 : 1.6;
  return units[largest > largestInFirstUnit ? 1 : 0]!;
}

export function guessMapping(table: Table): Mapping {
  const taken = new Set<number>();
  const find = (pattern: RegExp) => table.header.findIndex((name, i) => !taken.has(i) && pattern.test(name));
  const guessColumn = (role: Role): MappedColumn => {
    const index = NAMES[role].map(find).find((i) => i >= 0) ?? null;
    if (index === null) return { index, factor: UNITS[role][0]!.factor, sign: 1 };
    taken.add(index);
    const unit = unitByName(role, table.header[index]!) ?? unitBySize(role, numbersOf(table, index));
    return { index, factor: unit.factor, sign: 1 };
  };
  return Object.fromEntries(ROLES.map((role) => [role, guessColumn(role)])) as Mapping;
}
