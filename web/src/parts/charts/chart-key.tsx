import type { RefObject } from "preact";
import type { ChartKind } from "./chart-kinds";

/** The legend of a chart, with places for the values under the cursor; screen readers use the chart's label instead. */
export function ChartKey({ kind, element }: { kind: ChartKind; element: RefObject<HTMLSpanElement | null> }) {
  const lines = kind.lines.filter((line) => line.label);
  return (
    <span class="keys" aria-hidden="true" ref={element}>
      <span class="n cursor-time" />
      {lines.map(({ colour, dash, label }) => (
        <span class={`key key-${colour}${dash ? " dashed" : ""}`}>
          {label}
          <span class="n cursor-value" />
        </span>
      ))}
      {kind.showsGates && <span class="key key-gate">judged</span>}
    </span>
  );
}
