import { useMemo } from "preact/hooks";
import { judgeSign } from "../../live/correlation";
import { count } from "../../words/numbers";
import { finite, type Columns } from "./columns";
import type { Mapping } from "./mapping";
import type { Quantity } from "./quantities";
import { checkSigns } from "./sign-check";
import { SignRemark } from "./sign-remark";
import { TimeRemark } from "./time-remark";
import { likelyUnit } from "./time-unit";

/** Limits beyond which a unit must be wrong. */
const LARGEST_POSITION_M = 2;
const LARGEST_ANGLE_RAD = 1.6;

const isBeyond = (limit: number, ...columns: (number | null)[][]) =>
  columns.some((column) => finite(column).some((value) => Math.abs(value) > limit));

/** Counts the rows whose time is not after that of the previous row. */
function countNonIncreasing({ t_s }: Columns): number {
  const t = finite(t_s);
  return t.slice(1).filter((value, i) => value <= t[i]!).length;
}

interface Props {
  /** The samples per second of the rig. */
  rate: number;
  columns: Columns;
  mapping: Mapping;
  change: (mapping: Mapping) => void;
}

/** Checks of the mapped columns, with buttons that correct them. */
export function SanityCheck({ rate, columns, mapping, change }: Props) {
  const unit = useMemo(() => likelyUnit(columns, rate), [columns, rate]);
  const { t_s } = mapping;
  const check = useMemo(() => checkSigns(columns), [columns]);
  const nTimeless = t_s.index === null ? 0 : columns.t_s.length - finite(columns.t_s).length;
  const nNonIncreasing = countNonIncreasing(columns);
  const isFar = isBeyond(LARGEST_POSITION_M, columns.x_m, columns.y_m);
  const isSteep = isBeyond(LARGEST_ANGLE_RAD, columns.cmd_qx_rad, columns.cmd_qy_rad);
  const swap = () => change({ ...mapping, x_m: mapping.y_m, y_m: mapping.x_m });
  const flip = (quantity: Quantity) =>
    change({ ...mapping, [quantity]: { ...mapping[quantity], sign: mapping[quantity].sign === 1 ? -1 : 1 } });
  return (
    <ul class="sanity" aria-label="Sanity check">
      {nTimeless > 0 && (
        <li class="warn">
          {count(nTimeless)} rows are left out: their time is not a number (a date is not read as one).
        </li>
      )}
      {unit && (
        <TimeRemark
          unit={unit}
          rate={rate}
          correct={() => change({ ...mapping, t_s: { ...t_s, factor: t_s.factor * unit.factor } })}
        />
      )}
      {nNonIncreasing > 0 && <li class="warn">Time does not increase in {count(nNonIncreasing)} rows.</li>}
      {isFar && <li class="warn">Positions exceed 2 m: check the unit of the ball's position.</li>}
      {isSteep && <li class="warn">Commands exceed 90°: check the unit of the commands.</li>}
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
