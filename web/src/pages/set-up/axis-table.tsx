import type { ComponentChildren } from "preact";
import { NONE } from "../../words/numbers";

/** A row: its name and the text for an axis. */
export type AxisRow<T> = [name: string, text: (of: T) => string];

interface Props<T> {
  caption: string;
  rows: AxisRow<T>[];
  x?: T | null;
  y?: T | null;
  /** Further rows, which belong to both axes. */
  children?: ComponentChildren;
}

/** A table with a column for each axis. */
export function AxisTable<T>({ caption, rows, x, y, children }: Props<T>) {
  return (
    <table class="numbers">
      <thead>
        <tr>
          <th scope="col">{caption}</th>
          <th scope="col" class="n">
            x
          </th>
          <th scope="col" class="n">
            y
          </th>
        </tr>
      </thead>
      <tbody>
        {rows.map(([name, text]) => (
          <tr>
            <th scope="row">{name}</th>
            <td class="n">{x ? text(x) : NONE}</td>
            <td class="n">{y ? text(y) : NONE}</td>
          </tr>
        ))}
        {children}
      </tbody>
    </table>
  );
}
