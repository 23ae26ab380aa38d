import type { Axis } from "../../api/types";
import type { ChartGroup } from "./chart-group";
import type { ChartKindName } from "./chart-kinds";
import { RigChart } from "./rig-chart";

interface Props {
  group: ChartGroup;
  kinds: ChartKindName[];
  height?: number;
  axes?: Axis[];
  onSeek?: (t: number) => void;
  /** Called with the range over which the pointer was dragged, and without one after a double click. */
  onZoom?: (range: [number, number] | undefined) => void;
  /** Smallest extent of the scale on either side of zero, for charts that are compared. */
  minExtent?: number;
  /** Leaves out the twin's position and plate angle, which the recording of a fault does not have. */
  measuredOnly?: boolean;
}

/** The charts of a rig over time, one for each kind and axis. */
export function RigCharts({ kinds, axes = ["x", "y"], height = 150, ...rest }: Props) {
  return (
    <div class={`charts charts-${axes.length}`}>
      {kinds.flatMap((kind) =>
        axes.map((axis) => <RigChart key={kind + axis} kind={kind} axis={axis} height={height} {...rest} />),
      )}
    </div>
  );
}
