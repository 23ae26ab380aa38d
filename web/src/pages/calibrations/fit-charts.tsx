import { useEffect, useMemo } from "preact/hooks";
import type { Trace } from "../../api/types";
import { TraceBuffer } from "../../live/buffer";
import { ChartGroup } from "../../parts/charts/chart-group";
import { RigCharts } from "../../parts/charts/rig-charts";

/** Extent of the residual's scale in root mean squares, the same before and after. */
const EXTENT = 4;

/** The measured and the modelled acceleration, and the residual, of which `residual` is the larger size. */
export function FitCharts({ trace, residual }: { trace: Trace; residual: number }) {
  const group = useMemo(() => new ChartGroup(), []);
  const buffer = useMemo(() => TraceBuffer.of(trace), [trace]);
  useEffect(() => group.draw(buffer, [buffer.first, buffer.last]), [group, buffer]);
  return (
    <>
      <RigCharts group={group} kinds={["acceleration"]} height={130} />
      <RigCharts group={group} kinds={["residual"]} height={130} minExtent={EXTENT * residual} />
    </>
  );
}
