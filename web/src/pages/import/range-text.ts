import type { FileQuantity } from "../../api/types";
import { degrees, millimetres, NONE, seconds } from "../../words/numbers";
import type { Quantity } from "./quantities";

/** Returns the smallest and the largest value of a quantity in the units that people use. */
export function rangeText(name: Quantity, { from, to }: FileQuantity): string {
  if (from == null || to == null) return NONE;
  const text = name === "t_s" ? seconds : name.startsWith("cmd") ? degrees : millimetres;
  return `${text(from, 1)} to ${text(to, 1)}`;
}
