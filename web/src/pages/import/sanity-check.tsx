import { useMemo } from "preact/hooks";
import { judgeSign } from "../../live/correlation";
import { count } from "../../words/numbers";
import { finite, type Columns } from "./columns";
import type { Mapping } from "./mapping";
import type { Role } from "./roles";
import { checkSigns } from "./sign-check";
import { SignRemark } from "./sign-remark";

/** Beyond these a unit must be wrong. */
const LARGEST_POSITION_M = 2;
const LARGEST_ANGLE_RAD = 1.6;

const isBeyond = (limit: number, ...columns: (number | null)[][]) =>
  columns.some((column) => finite(column).some((value) => Math.abs(value) > limit));

/** Rows whose time is not later than that of the row before. */
function countStandstills({ t_s }: Columns): number {
  const t = finite(t_s);
  return t.slice(1).filter((value, i) => value <= t[i]!).length;
}

interface Props {
  columns: Columns;
  mapping: Mapping;
  change: (mapping: Mapping) => void;
}

/** What looks wrong with the columns as they are mapped, and buttons that put it right. */
export function SanityCheck({ columns, mapping, change }: Props) {
  const check = useMemo(() => checkSigns(columns), [columns]);
  const nStandstills = countStandstills(columns);
  const isFar = isBeyond(LARGEST_POSITION_M, columns.x_m, columns.y_m);
  const isSteep = isBeyond(LARGEST_ANGLE_RAD, columns.cmd_qx_rad, columns.cmd_qy_rad);
  const swap = () => change({ ...mapping, x_m: mapping.y_m, y_m: mapping.x_m });
  const flip = (role: Role) =>
    change({ ...mapping, [role]: { ...mapping[role], sign: mapping[role].sign === 1 ? -1 : 1 } });
  return (
    <ul class="sanity" aria-label="Sanity check">
      {nStandstills > 0 && (
        <li class="warn">Time stands still or goes back in {count(nStandstills)} rows.</li>
      )}
      {isFar && <li class="warn">The ball is metres away: is the unit of its position right?</li>}
      {isSteep && <li class="warn">The plate tilts beyond 90°: is the unit of the commands right?</li>}
      {(["x", "y"] as const).map((axis) => (
        <SignRemark
          axis={axis}
          verdict={judgeSign(check[axis])}
          correlation={check[axis].own}
          flip={() => flip(`${axis}_m`)}
          swap={swap}
        />
      ))}
    </ul>
  );
}
