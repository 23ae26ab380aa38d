/** Limits and debounce times that are tried on a session. */
import type { FaultCode, TriedMonitor } from "../../api/types";
import type { Mark } from "../../parts/charts/overlays";
import { codeTitle } from "../../words/fault-names";

/** What is tried for one monitor; without a value it is as set. */
export interface TriedValues {
  /** Factor on the limits of a servo. */
  limit?: number;
  debounce_s?: number;
}

export type TriedSettings = Partial<Record<FaultCode, TriedValues>>;

/** The monitors whose limits can be tried. */
export const hasLimit = (code: FaultCode) => code === "x_servo" || code === "y_servo";

/** Returns the parameters of the request. */
export function trialQuery(settings: TriedSettings): Record<string, number | undefined> {
  const entries = Object.entries(settings).flatMap(([code, { limit, debounce_s }]) => [
    [`${code}_limit`, limit],
    [`${code}_debounce_s`, debounce_s],
  ]);
  return Object.fromEntries(entries) as Record<string, number | undefined>;
}

/** Whether anything is tried. */
export const isTried = (settings: TriedSettings) =>
  Object.values(trialQuery(settings)).some((value) => value !== undefined);

/** The limit slider moves by powers of ten. */
export const factorAt = (position: number) => Number((10 ** position).toPrecision(3));
export const positionOf = (factor: number) => Math.log10(factor);

/** The marks of the alarms that other settings raise, which `word` names. */
export const alarmMarks = (monitors: TriedMonitor[], word: string): Mark[] =>
  monitors.flatMap(({ thresholds: { code }, alarms_t_s }) =>
    alarms_t_s.map((t) => ({
      t,
      label: `${codeTitle(code)}, ${word}`,
      colour: "warn",
      axis: code === "x_servo" ? "x" : code === "y_servo" ? "y" : null,
    })),
  );
