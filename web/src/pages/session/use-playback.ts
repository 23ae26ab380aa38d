import { useEffect, useRef, useState } from "preact/hooks";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import type { TraceBuffer } from "../../live/buffer";
import { useLocation } from "../../router/navigation";

/** Longest step of one frame, s: a tab that was hidden does not catch up. */
const LONGEST_STEP_S = 0.1;

/** The start time in the address, if there is one, s. */
function useStart(): number | undefined {
  const text = useLocation().query.get("t");
  const start = Number(text ?? NaN);
  return Number.isFinite(start) ? start : undefined;
}

/** The playback of a recording. The current time stays when the buffer changes. */
export function usePlayback(buffer: TraceBuffer | undefined) {
  const start = useStart();
  /** Current time, s on the device's clock; a ref, as it changes with every frame. */
  const t = useRef(NaN);
  const [isPlaying, setPlaying] = useState(false);
  const [speed, setSpeed] = useState<number>(1);
  const frameAt = useRef(0);
  useEffect(() => {
    if (buffer?.t.length && Number.isNaN(t.current)) t.current = start ?? buffer.first;
  }, [buffer, start]);
  useAnimationFrame((now) => {
    const elapsed = Math.min((now - frameAt.current) / 1000, LONGEST_STEP_S);
    frameAt.current = now;
    if (!buffer?.t.length || !isPlaying) return;
    t.current = Math.min(t.current + elapsed * speed, buffer.last);
    if (t.current === buffer.last) setPlaying(false);
  });
  const seek = (to: number) => {
    if (buffer) t.current = Math.min(Math.max(to, buffer.first), buffer.last);
  };
  const toggle = () => {
    if (!isPlaying && buffer && t.current >= buffer.last) t.current = buffer.first;
    setPlaying(!isPlaying);
  };
  return { t, isPlaying, toggle, seek, speed, setSpeed };
}

export type Playback = ReturnType<typeof usePlayback>;
