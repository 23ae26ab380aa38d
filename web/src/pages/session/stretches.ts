import type { Session } from "../../api/types";

/** Most samples of a trace, with a margin below the service's limit of two million. */
const MOST_SAMPLES = 1_500_000;

/** A range of times on the device's clock, s. */
export interface Stretch {
  from_s: number;
  to_s: number;
}

/** Returns the stretches of equal length in which a long recording is shown, one after the other;
 * none if the whole recording can be shown. */
export function stretches(session: Pick<Session, "samples" | "first_t_s" | "last_t_s">): Stretch[] {
  const { samples, first_t_s: first, last_t_s: last } = session;
  const n = Math.ceil(samples / MOST_SAMPLES);
  if (n <= 1 || first == null || last == null) return [];
  const length = (last - first) / n;
  return Array.from({ length: n }, (_, i) => ({
    from_s: first + i * length,
    to_s: i === n - 1 ? last : first + (i + 1) * length,
  }));
}

/** Returns the index of the stretch that contains `t`, if there is one. */
export function stretchAt(pieces: Stretch[], t?: number): number | undefined {
  const found = t === undefined ? -1 : pieces.findIndex(({ from_s, to_s }) => from_s <= t && t <= to_s);
  return found < 0 ? undefined : found;
}

/** Returns a stretch in words, in hours after the start of the recording. */
export function stretchText({ from_s, to_s }: Stretch, first_s: number): string {
  const hours = (t_s: number) => ((t_s - first_s) / 3600).toFixed(2);
  return `${hours(from_s)} h to ${hours(to_s)} h`;
}
