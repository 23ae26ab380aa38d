import type { ChartKind } from "./chart-kinds";

/** The legend of a chart; screen readers use the label of the chart instead. */
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
