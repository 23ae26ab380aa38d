import { useEffect } from "preact/hooks";
import { useLatest } from "./use-latest";

/** Calls `draw` before each frame while the tab is visible. */
export function useAnimationFrame(draw: (now: number) => void): void {
  const latest = useLatest(draw);
  useEffect(() => {
    let frame = requestAnimationFrame(function loop(now) {
      latest.current(now);
      frame = requestAnimationFrame(loop);
    });
    return () => cancelAnimationFrame(frame);
  }, [latest]);
}
