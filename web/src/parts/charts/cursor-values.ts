/** The values under the cursor, written into the legend of a chart without rendering components. */
import { number } from "../../words/numbers";
import type { ChartKind } from "./chart-kinds";

/** Decimals of a value, in addition to those of the axis. */
const MORE_DIGITS = 2;

export class CursorValues {
  private readonly time: Element | null;
  private readonly places: NodeListOf<Element>;

  /** `key` is the legend: an element `.cursor-time`, and a `.cursor-value` for each labelled line. */
  constructor(
    key: Element,
    private readonly kind: ChartKind,
  ) {
    this.time = key.querySelector(".cursor-time");
    this.places = key.querySelectorAll(".cursor-value");
  }

  /** Shows the values of all lines at the time `t`; nothing without a time. */
  show(t: number | null, values: (number | null | undefined)[]): void {
    if (this.time) this.time.textContent = t === null ? "" : `at ${number(t, 2, "s")}`;
    const labelled = this.kind.lines.flatMap(({ label }, i) => (label ? [i] : []));
    labelled.forEach((line, i) => {
      const place = this.places[i];
      if (place)
        place.textContent = t === null ? "" : ` ${number(values[line], this.kind.digits + MORE_DIGITS)}`;
    });
  }
}
