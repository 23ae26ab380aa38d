import { useMemo } from "preact/hooks";
import type { Axis } from "../../api/types";
import { AXES } from "../../live/buffer";
import { ThinnedNote } from "../../parts/charts/thinned-note";
import { count, number } from "../../words/numbers";
import { residualHistogram } from "./histogram";
import { HistogramPlot } from "./histogram-plot";
import { useShown, type Shown } from "./use-shown";

/** How the residual of the shown range is distributed, with the limit. */
export function ResidualHistograms({ shown }: { shown: () => Shown | undefined }) {
  const state = useShown(shown);
  return (
    <details class="histograms">
      <summary>Histogram of the residual in the shown range</summary>
      <ThinnedNote stride={state?.stride ?? 1} use="counted" hint="Show less time to count all of them." />
      <div class="charts charts-2">
        {AXES.map((axis) => (
          <AxisHistogram axis={axis} shown={state} />
        ))}
      </div>
    </details>
  );
}

/** What is counted: every judged moment, or one of a few of them. */
const momentsWord = (stride: number) => (stride > 1 ? "counted moments" : "judged moments");

function AxisHistogram({ axis, shown }: { axis: Axis; shown?: Shown }) {
  const histogram = useMemo(() => shown && residualHistogram(shown.buffer, axis, shown.range), [axis, shown]);
  if (!histogram) return <p class="quiet">Along {axis} nothing was judged here.</p>;
  const { extent, limit, n, nBeyond } = histogram;
  const moments = momentsWord(shown?.stride ?? 1);
  return (
    <figure class="histogram">
      <HistogramPlot axis={axis} histogram={histogram} moments={moments} />
      <figcaption class="small-text">
        <b>{axis}</b>, −{number(extent, 2)} to {number(extent, 2, "m/s²")}; limit ±{number(limit, 3, "m/s²")};{" "}
        {count(nBeyond)} of {count(n)} {moments} at or beyond it
      </figcaption>
    </figure>
  );
}
