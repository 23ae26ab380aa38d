/** Which columns of a file are which quantities, as the service writes it. */
import type { FileColumn, FileInspection } from "../../api/types";
import { QUANTITIES, UNITS, type Quantity } from "./quantities";

/** The expression of each quantity, such as `ball_x/mm`; empty where nothing is known. */
export type Mapping = Record<Quantity, string>;

/** What leaves a quantity out. */
export const LEFT_OUT = "none";

/** A column in a unit, perhaps with the opposite sign: what most expressions are. */
export interface SimpleExpression {
  /** The column as a mapping names it. */
  column: string;
  unit: string;
  sign: "" | "-";
}

export const written = ({ column, unit, sign }: SimpleExpression) => `${sign}${column}/${unit}`;

/** Returns the parts of `expression`; undefined if it is not a simple one. */
export function simpleExpression(
  expression: string,
  quantity: Quantity,
  columns: FileColumn[],
): SimpleExpression | undefined {
  for (const { written: column } of columns)
    for (const { written: unit } of UNITS[quantity])
      for (const sign of ["", "-"] as const)
        if (written({ column, unit, sign }) === expression) return { column, unit, sign };
  return undefined;
}

/** Returns the mapping by which the file was read. */
export function mappingOf({ quantities }: FileInspection): Mapping {
  const expression = (name: Quantity) =>
    quantities.find(({ quantity }) => quantity === name)?.expression ?? "";
  return Object.fromEntries(QUANTITIES.map((name) => [name, expression(name)])) as Mapping;
}

/** Returns the mapping as the parameter `columns` of an import. */
export const columnsParameter = (mapping: Mapping) =>
  QUANTITIES.filter((name) => mapping[name] !== "")
    .map((name) => `${name}=${mapping[name]}`)
    .join(", ");

/** Returns a sentence of the service without the quotes of its words. */
export const plainText = (sentence: string) => sentence.replaceAll("`", "");
