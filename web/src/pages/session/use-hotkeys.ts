import { useEffect } from "preact/hooks";
import { useLatest } from "../../hooks/use-latest";
import type { Playback } from "./use-playback";

/** Step of each arrow key, s. */
const STEPS: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1 };

/** Focused elements that handle the space bar themselves, and those that handle arrow keys. */
const HANDLES_SPACE = "input, select, button, canvas, a, summary";
const HANDLES_ARROWS = "input, select, canvas";

/** Space plays, arrow keys step by a second. */
export function useHotkeys(playback: Playback): void {
  const latest = useLatest(playback);
  useEffect(() => {
    const pressed = (event: KeyboardEvent) => {
      const { toggle, seek, t } = latest.current;
      const step = STEPS[event.key];
      if (event.key !== " " && !step) return;
      if ((event.target as HTMLElement).closest(step ? HANDLES_ARROWS : HANDLES_SPACE)) return;
      event.preventDefault();
      if (step) seek(t.current + step);
      else toggle();
    };
    addEventListener("keydown", pressed);
    return () => removeEventListener("keydown", pressed);
  }, [latest]);
}
