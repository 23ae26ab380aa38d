import { useEffect } from "preact/hooks";
import { useLatest } from "./use-latest";

/** Time between two frames for a person who asks for less motion, ms. Chosen. */
const CALM_MS = 100;

const calm = matchMedia("(prefers-reduced-motion: reduce)");

/**
 * Calls `draw` before each frame while the tab is visible, or ten times a second if the system
 * asks for less motion.
 */
export function useAnimationFrame(draw: (now: number) => void): void {
  const latest = useLatest(draw);
  useEffect(() => {
    let frame = 0;
    let pause: ReturnType<typeof setTimeout> | undefined;
    const next = () => (frame = requestAnimationFrame(loop));
    function loop(now: number) {
      latest.current(now);
      if (calm.matches) pause = setTimeout(next, CALM_MS);
      else next();
    }
    next();
    return () => {
      cancelAnimationFrame(frame);
      clearTimeout(pause);
    };
  }, [latest]);
}
