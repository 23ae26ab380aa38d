/** Deviation beyond which the clock jumps to its target instead of catching up, s. */
const JUMP_S = 2;

/** Largest relative change of the clock's rate. */
const MAX_CORRECTION = 0.5;

/**
 * The clock of the live view: it follows the device's clock smoothly with a small delay, so that
 * samples that arrive in batches are shown at an even rate.
 */
export class PlayoutClock {
  private shown = NaN;
  private before = NaN;

  /** `delay` behind the newest sample, s; longer than a batch of the demo. */
  constructor(private readonly delay = 0.25) {}

  /** Returns the time to show at `now`, ms on the page's clock; `newest` is that of the last received sample, s. */
  tick(now: number, newest: number): number {
    const elapsed = Number.isNaN(this.before) ? 0 : (now - this.before) / 1000;
    this.before = now;
    const target = newest - this.delay;
    const deviation = target - this.shown;
    if (Number.isNaN(deviation) || Math.abs(deviation) > JUMP_S) {
      this.shown = target;
    } else {
      const correction = Math.min(Math.max(deviation, -MAX_CORRECTION), MAX_CORRECTION);
      this.shown = Math.min(this.shown + elapsed * (1 + correction), newest);
    }
    return this.shown;
  }
}
