import { useMemo, useState } from "preact/hooks";
import type { Axis, FaultCode, Thresholds } from "../../api/types";
import type { ChartGroup } from "../../parts/charts/chart-group";
import type { ChartKindName } from "../../parts/charts/chart-kinds";
import { RigChart } from "../../parts/charts/rig-chart";
import { Choice } from "../../parts/choice";
import { codeTitle } from "../../words/fault-names";
import { debounceText, evidenceLines } from "./decision-lines";

interface Props {
  group: ChartGroup;
  /** The values at which the monitors decide. */
  thresholds: Thresholds[];
  height: number;
  onSeek?: (t: number) => void;
  onZoom?: (range: [number, number] | undefined) => void;
}

/** Where a monitor is drawn: its counter, and the axis of its servo. */
const DRAWN: Record<FaultCode, { counter: ChartKindName; axis?: Axis }> = {
  x_servo: { counter: "counter", axis: "x" },
  y_servo: { counter: "counter", axis: "y" },
  stuck_ball: { counter: "stuckBall" },
  sensor: { counter: "sensor" },
};

/** The charts of one monitor, which can be chosen: at first that of `first`. */
export function MonitorCharts({ first = "x_servo", ...chart }: Props & { first?: FaultCode }) {
  const [code, setCode] = useState(first);
  const monitors = chart.thresholds.map((one) => [one.code, codeTitle(one.code)] as const);
  return (
    <>
      <Choice isInline label="Monitor" options={monitors} value={code} change={setCode} />
      <ChartsOfMonitor code={code} {...chart} />
    </>
  );
}

/** The evidence and the debounce counter of one monitor, against the values at which they decide. */
export function ChartsOfMonitor({ code, thresholds, ...chart }: Props & { code: FaultCode }) {
  const found = thresholds.find((one) => one.code === code);
  const evidence = useMemo(() => found && evidenceLines(found), [found]);
  const { counter, axis } = DRAWN[code];
  return (
    <>
      <div class="charts charts-2">
        {axis && evidence && evidence.length > 0 && (
          <RigChart
            key={`evidence ${axis}`}
            kind="evidence"
            axis={axis}
            thresholds={evidence}
            minExtent={found?.confirm_nats ?? undefined}
            {...chart}
          />
        )}
        <RigChart key={code} kind={counter} axis={axis ?? "x"} {...chart} />
      </div>
      {found && <p class="quiet small-text">{debounceText(found)}</p>}
    </>
  );
}
