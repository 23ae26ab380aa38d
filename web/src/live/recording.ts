/** The seconds around a fault, made into a trace that the charts can draw. */
import type { FaultRecording, Trace } from "../api/types";
import type { Column } from "./axis-columns";

type Columns = FaultRecording["columns"];

/** Longest time in which nothing is judged that lines are drawn across, s. */
const LONGEST_GAP_S = 0.2;

/** The rows that were judged, and others where none was for a while. */
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

/** A recording does not say where the twin and its plate were: these columns are empty. */
export function traceOfRecording({ columns }: FaultRecording): Trace {
  const c = drawable(columns);
  const none: Column = c.t_s.map(() => null);
  const unknown = { plate_angle_rad: none, twin_position_m: none };
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
  return { t_s: c.t_s, x, y } as unknown as Trace;
}
