import type { AssetAxes, Evidence } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { DEGREE } from "./description";

/** Limits beyond which a unit must be wrong. */
const LARGEST_POSITION_M = 2;
const LARGEST_ANGLE_RAD = 1.6;

interface Props {
  evidence?: Evidence;
  change: (axes: Partial<AssetAxes>) => Promise<void>;
}

/** Warnings of implausible values, with a button for the probable unit. */
export function UnitWarnings({ evidence, change }: Props) {
  const axes = evidence ? [evidence.x, evidence.y] : [];
  const isFar = axes.some((axis) => Math.abs(axis.position_m ?? 0) > LARGEST_POSITION_M);
  const isSteep = axes.some((axis) => Math.abs(axis.command_rad ?? 0) > LARGEST_ANGLE_RAD);
  return (
    <>
      {isFar && (
        <p class="trouble" role="alert">
          The position of the ball exceeds 2 m.{" "}
          <ActionButton action={() => change({ position_unit_m: 0.001 })} needs="operator">
            Positions are in mm
          </ActionButton>
        </p>
      )}
      {isSteep && (
        <p class="trouble" role="alert">
          A command exceeds 90°.{" "}
          <ActionButton action={() => change({ command_unit_rad: DEGREE })} needs="operator">
            Commands are in degrees
          </ActionButton>
        </p>
      )}
    </>
  );
}
