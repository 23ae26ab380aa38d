/**
 * Fits a parabola to the readings of `column` from index `from` to `to` by least squares and returns
 * its second derivative; null if there are too few readings.
 */
export function curvature(
  t: (number | null)[],
  column: (number | null)[],
  from: number,
  to: number,
): number | null {
  const middle = t[(from + to) >> 1];
  if (middle == null) return null;
  // Sums of the powers of time, and of their products with the readings.
  const s = [0, 0, 0, 0, 0];
  const b = [0, 0, 0];
  for (let i = from; i <= to; i++) {
    const time = t[i];
    const value = column[i];
    if (time == null || value == null) continue;
    let power = 1;
    for (let k = 0; k < 5; k++) {
      s[k]! += power;
      if (k < 3) b[k]! += power * value;
      power *= time - middle;
    }
  }
  return solve(s as Sums, b as [number, number, number]);
}

/** Smallest number of readings for a fit. */
const MIN_READINGS = 6;

/** Smallest determinant: readings at too few distinct times are singular. */
const MIN_DETERMINANT = 1e-18;

type Sums = [number, number, number, number, number];

/** Twice the parabola's leading coefficient, by Cramer's rule on the normal equations. */
function solve([s0, s1, s2, s3, s4]: Sums, [b0, b1, b2]: [number, number, number]): number | null {
  if (s0 < MIN_READINGS) return null;
  const determinant = s0 * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s2 * s3) + s2 * (s1 * s3 - s2 * s2);
  if (Math.abs(determinant) < MIN_DETERMINANT) return null;
  const leading = s0 * (s2 * b2 - s3 * b1) - s1 * (s1 * b2 - s2 * b1) + b0 * (s1 * s3 - s2 * s2);
  return (2 * leading) / determinant;
}
