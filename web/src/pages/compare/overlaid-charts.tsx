import type { Axis } from "../../api/types";
import type { ChartKindName } from "../../parts/charts/chart-kinds";
import { ThinnedNote } from "../../parts/charts/thinned-note";
import { OverlaidChart } from "./overlaid-chart";
import type { Recording } from "./use-recording";

interface Props {
  a: Recording;
  b: Recording;
  shift: number;
  kinds: ChartKindName[];
  axis: Axis;
  range: [number, number];
  onZoom: (range: [number, number] | undefined) => void;
}

/** The charts of two recordings, each with a curve of both and of their difference. */
export function OverlaidCharts({ kinds, ...chart }: Props) {
  const { a, b } = chart;
  return (
    <section class="card">
      <h2>Overlaid</h2>
      <ThinnedNote
        stride={Math.max(a.trace.stride, b.trace.stride)}
        hint="The page of the session shows all of them."
      />
      {kinds.map((kind) => (
        <OverlaidChart key={kind} kind={kind} {...chart} />
      ))}
    </section>
  );
}
