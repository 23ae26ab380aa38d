/** The sample rate, from the sample counts in the states of a rig. */
import type { State } from "../api/types";

/** Length of the window of the measurement, s. */
const SPAN_S = 10;

/** Smallest number of samples for a rate. */
const MIN_SAMPLES = 20;

type Count = Pick<State, "judged"> & { t_s?: number | null };

export class SampleRate {
  private counts: { t_s: number; judged: number }[] = [];

  /** Adds the count of a state; a count or time that decreases starts a new measurement. */
  take({ t_s, judged }: Count): void {
    if (t_s == null) return;
    const last = this.counts[this.counts.length - 1];
    if (last && (t_s < last.t_s || judged < last.judged)) this.counts = [];
    if (last?.t_s !== t_s) this.counts.push({ t_s, judged });
    while (this.counts.length > 2 && this.counts[1]!.t_s <= t_s - SPAN_S) this.counts.shift();
  }

  /** The sample rate, Hz; null if there are too few samples. */
  get hz(): number | null {
    const first = this.counts[0];
    const last = this.counts[this.counts.length - 1];
    if (!first || !last || last.judged - first.judged < MIN_SAMPLES) return null;
    return (last.judged - first.judged) / (last.t_s - first.t_s);
  }
}
