import { useEffect } from "preact/hooks";
import { useLatest } from "../../hooks/use-latest";
import type { Playback } from "./use-playback";

/** Step of each arrow key, s. */
const STEPS: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1 };

/** Focused elements that handle these keys themselves. */
const HANDLES_KEYS = "input, select, button, canvas, a";

/** Space plays, arrow keys step by a second. */
export function useHotkeys(playback: Playback): void {
  const latest = useLatest(playback);
  useEffect(() => {
    const pressed = (event: KeyboardEvent) => {
      const { toggle, seek, t } = latest.current;
      const step = STEPS[event.key];
      if ((event.target as HTMLElement).closest(HANDLES_KEYS)) return;
      if (event.key !== " " && !step) return;
      event.preventDefault();
      if (step) seek(t.current + step);
      else toggle();
    };
    addEventListener("keydown", pressed);
    return () => removeEventListener("keydown", pressed);
  }, [latest]);
}
