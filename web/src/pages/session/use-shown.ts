import { useRef, useState } from "preact/hooks";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import type { TraceBuffer } from "../../live/buffer";

export interface Shown {
  buffer: TraceBuffer;
  range: [number, number];
  /** Every how many judged moments the buffer has one. */
  stride: number;
}

/** Least time between two updates, ms: what is rendered from it is slower than a chart. */
const EVERY_MS = 250;

/** What the charts show, as a state that changes a few times per second; `shown` is called before each frame. */
export function useShown(shown: () => Shown | undefined): Shown | undefined {
  const [state, setState] = useState<Shown>();
  const updatedAt = useRef(-Infinity);
  useAnimationFrame((now) => {
    const next = shown();
    const isSame = next?.buffer === state?.buffer && next?.range.join() === state?.range.join();
    if (isSame || now - updatedAt.current < EVERY_MS) return;
    updatedAt.current = now;
    setState(next);
  });
  return state;
}
