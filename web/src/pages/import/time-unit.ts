/** Finds a wrong unit of the time by the rate of the rig. */
import { finite, type Columns } from "./columns";

/** Number of rows whose spacing is looked at. */
const EXAMINED = 2000;

/** The spacing is called 1000 times too long if it is so within this factor. */
const TOLERANCE = 3;

export interface LikelyUnit {
  word: "ms" | "µs";
  /** Factor from the chosen unit to this one. */
  factor: number;
  /** Median time between two rows with the chosen unit, s. */
  spacing: number;
}

const UNITS = [
  { word: "ms", factor: 1e-3 },
  { word: "µs", factor: 1e-6 },
] as const;

/** The median time between two rows, s; NaN with fewer than two. */
function medianSpacing({ t_s }: Columns): number {
  const t = finite(t_s.slice(0, EXAMINED));
  const steps = t.slice(1).map((value, i) => value - t[i]!);
  return steps.sort((a, b) => a - b)[steps.length >> 1] ?? NaN;
}

/** Returns the unit in which the time probably is, if the rows come 1000 or a million times too slowly for `rate`. */
export function likelyUnit(columns: Columns, rate: number): LikelyUnit | undefined {
  const spacing = medianSpacing(columns);
  const isLikely = ({ factor }: { factor: number }) => {
    const ratio = spacing * factor * rate;
    return ratio > 1 / TOLERANCE && ratio < TOLERANCE;
  };
  const unit = UNITS.find(isLikely);
  return unit && { ...unit, spacing };
}
