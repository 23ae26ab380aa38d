import { useEffect, useRef, useState } from "preact/hooks";
import { useAnimationFrame } from "../../hooks/use-animation-frame";
import type { TraceBuffer } from "../../live/buffer";
import { firstSeen, playedOn } from "./playback-time";
import { useAddress } from "./use-address";

/** The playback of a recording. The current time stays when the buffer changes. */
export function usePlayback(buffer: TraceBuffer | undefined) {
  const { address, write } = useAddress();
  /** Current time, s on the device's clock; a ref, as it changes with every frame. */
  const t = useRef(NaN);
  const [isPlaying, setPlaying] = useState(false);
  const [speed, setSpeed] = useState<number>(address.speed);
  const frameAt = useRef(0);
  const start = useRef(address.t);
  useEffect(() => {
    if (!buffer?.t.length || !Number.isNaN(t.current)) return;
    const wanted = start.current ?? firstSeen(buffer);
    t.current = Math.min(Math.max(wanted, buffer.first), buffer.last);
  }, [buffer]);
  useAnimationFrame((now) => {
    const elapsed = now - frameAt.current;
    frameAt.current = now;
    if (!buffer?.t.length || !isPlaying) return;
    t.current = playedOn(t.current, elapsed, speed, buffer.last);
    if (t.current === buffer.last) setPlaying(false);
  });
  const seek = (to: number) => {
    if (!buffer) return;
    t.current = Math.min(Math.max(to, buffer.first), buffer.last);
    write({ t: t.current });
  };
  const toggle = () => {
    if (!isPlaying && buffer && t.current >= buffer.last) t.current = buffer.first;
    if (isPlaying) write({ t: t.current });
    setPlaying(!isPlaying);
  };
  const changeSpeed = (next: number) => {
    setSpeed(next);
    write({ speed: next });
  };
  return { t, isPlaying, toggle, seek, speed, setSpeed: changeSpeed };
}

export type Playback = ReturnType<typeof usePlayback>;
