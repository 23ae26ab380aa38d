/** Further from where it should be than this, the clock jumps instead of catching up, s. */
const JUMP_S = 2;

/** The clock runs at most this share faster or slower than true time. */
const MOST_CORRECTION = 0.5;

/**
 * The clock by which live pictures are shown: it follows the device's clock
 * smoothly, a little behind, so that batches that come in bursts move evenly.
 */
export class PlayoutClock {
  private shown = NaN;
  private before = NaN;

  /** Seconds behind the newest moment; more than a demo's batch is long. */
  constructor(private readonly behind = 0.25) {}

  /** The moment to show at `now`, ms of the page's clock, when `newest` is the latest that has come, s. */
  tick(now: number, newest: number): number {
    const elapsed = Number.isNaN(this.before) ? 0 : (now - this.before) / 1000;
    this.before = now;
    const target = newest - this.behind;
    const off = target - this.shown;
    if (Number.isNaN(off) || Math.abs(off) > JUMP_S) {
      this.shown = target;
    } else {
      const correction = Math.min(Math.max(off, -MOST_CORRECTION), MOST_CORRECTION);
      this.shown = Math.min(this.shown + elapsed * (1 + correction), newest);
    }
    return this.shown;
  }
}
