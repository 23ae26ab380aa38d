import type { Trace } from "../../api/types";
import { AXES } from "../../live/buffer";
import { ThinnedNote } from "../../parts/charts/thinned-note";
import { FitCharts } from "./fit-charts";
import { fitSentence, residualRms } from "./residual";

interface Props {
  traces: { before: Trace; after: Trace };
  /** What each of them was judged with, in words. */
  before: string;
  after: string;
}

/** The charts of a session with two calibrations, and their residuals in words. */
export function Fit({ traces, before, after }: Props) {
  const rms = AXES.map((axis) => ({
    axis,
    before: residualRms(traces.before, axis),
    after: residualRms(traces.after, axis),
  }));
  const largest = Math.max(...rms.flatMap((of) => [of.before ?? 0, of.after ?? 0]));
  const stride = Math.max(traces.before.stride, traces.after.stride);
  return (
    <>
      <ThinnedNote stride={stride} use="drawn and counted" />
      {rms.map((of) => (
        <p>{fitSentence(of.axis, of.before, of.after)}</p>
      ))}
      <h3>Before: {before}</h3>
      <FitCharts trace={traces.before} residual={largest} />
      <h3>After: {after}</h3>
      <FitCharts trace={traces.after} residual={largest} />
    </>
  );
}
