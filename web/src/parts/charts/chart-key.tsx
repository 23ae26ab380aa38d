import type { ChartKind } from "./chart-kinds";

/** Which line is what; the chart's own name says it to whoever does not see it. */
export function ChartKey({ kind }: { kind: ChartKind }) {
  const lines = kind.lines.filter((line) => line.label);
  return (
    <span class="keys" aria-hidden="true">
      {lines.map(({ colour, dash, label }) => (
        <span class={`key key-${colour}${dash ? " dashed" : ""}`}>{label}</span>
      ))}
      {kind.showsGates && <span class="key key-gate">judged</span>}
    </span>
  );
}
