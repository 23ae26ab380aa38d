import { useMemo, useState } from "preact/hooks";
import type { Axis } from "../../api/types";
import { AXES } from "../../live/buffer";
import { ChartGroup } from "../../parts/charts/chart-group";
import { SESSION_CHARTS } from "../../parts/charts/chart-kinds";
import { Choice } from "../../parts/choice";
import { FoundCard } from "../session/found-card";
import { alignedTrace, commonRange } from "./align";
import { ComparedCharts } from "./compared-charts";
import { OverlaidCharts } from "./overlaid-charts";
import { ShiftField } from "./shift-field";
import type { Recording } from "./use-recording";

const KINDS = ["residual" as const, "counter" as const, ...SESSION_CHARTS];

const LAYOUTS = [
  ["beside", "side by side"],
  ["over", "overlaid"],
] as const;

const AXIS_OPTIONS = AXES.map((axis) => [axis, axis] as const);

/** The charts of both recordings, with the same scales. */
function groupsOfOneScale(): [ChartGroup, ChartGroup] {
  const groups: [ChartGroup, ChartGroup] = [new ChartGroup(), new ChartGroup()];
  groups[0].share(groups[1]);
  return groups;
}

interface Props {
  a: Recording;
  b: Recording;
  shift: number;
  setShift: (shift: number) => void;
}

/** Two recordings on one time axis, and their verdicts. */
export function Comparison({ a, b, shift, setShift }: Props) {
  const [axis, setAxis] = useState<Axis>("x");
  const [layout, setLayout] = useState<"beside" | "over">("beside");
  const [groups] = useState(groupsOfOneScale);
  const [zoom, setZoom] = useState<[number, number]>();
  const whole = useMemo<[number, number]>(
    () => commonRange(alignedTrace(a.trace, 0), alignedTrace(b.trace, shift)) ?? [0, 1],
    [a, b, shift],
  );
  const chart = { range: zoom ?? whole, axis, kinds: KINDS, onZoom: setZoom };
  return (
    <>
      <section class="card player">
        <ShiftField shift={shift} set={setShift} />
        <Choice isInline label="Axis" options={AXIS_OPTIONS} value={axis} change={setAxis} />
        <Choice isInline label="Charts" options={LAYOUTS} value={layout} change={setLayout} />
        <button type="button" disabled={!zoom} onClick={() => setZoom(undefined)}>
          Zoom out
        </button>
      </section>
      {layout === "over" && <OverlaidCharts a={a} b={b} shift={shift} {...chart} />}
      <div class="compared">
        {layout === "beside" && (
          <>
            <ComparedCharts group={groups[0]} recording={a} start={0} {...chart} />
            <ComparedCharts group={groups[1]} recording={b} start={shift} {...chart} />
          </>
        )}
        {[a, b].map((one) => (
          <FoundCard session={one.session} asset={one.asset} faults={one.faults} />
        ))}
      </div>
      <p class="quiet small-text">
        Times are seconds after the start of the first session. Drag over a chart to zoom into both,
        double-click to zoom out.
      </p>
    </>
  );
}
