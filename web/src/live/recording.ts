/** Converts the recording of a fault to a trace for the charts. */
import type { FaultRecording, Trace } from "../api/types";
import type { Column } from "./axis-columns";

type Columns = FaultRecording["columns"];

/** Longest interval without a judged row across which lines are drawn, s. */
const LONGEST_GAP_S = 0.2;

/** Returns the judged rows, and some of the others in gaps between judged rows. */
function drawable(columns: Columns): Columns {
  let last = -Infinity;
  const kept = columns.t_s.flatMap((t, i) => {
    const isJudged = columns.x_limit_m_s2[i] != null;
    if (!isJudged && t - last < LONGEST_GAP_S) return [];
    last = t;
    return [i];
  });
  const entries = Object.entries(columns).map(([name, column]) => [name, kept.map((i) => column[i])]);
  return Object.fromEntries(entries) as Columns;
}

/** Returns the trace of a recording; it has no positions of the twin and its plate. */
export function traceOfRecording({ columns }: FaultRecording): Trace {
  const c = drawable(columns);
  const none: Column = c.t_s.map(() => null);
  const unknown = { plate_angle_rad: none, twin_position_m: none, counter: none, nats: none };
  const x = {
    ...unknown,
    command_rad: c.cmd_qy_rad,
    position_m: c.x_m,
    measured_m_s2: c.x_measured_m_s2,
    twin_m_s2: c.x_twin_m_s2,
    limit_m_s2: c.x_limit_m_s2,
    enabled: c.x_enabled.map(Boolean),
  };
  const y = {
    ...unknown,
    command_rad: c.cmd_qx_rad,
    position_m: c.y_m,
    measured_m_s2: c.y_measured_m_s2,
    twin_m_s2: c.y_twin_m_s2,
    limit_m_s2: c.y_limit_m_s2,
    enabled: c.y_enabled.map(Boolean),
  };
  return { t_s: c.t_s, x, y, stuck_ball_counter: none, sensor_counter: none, stride: 1 } as unknown as Trace;
}
