/** Small hooks that several views share. */
import { useCallback, useEffect, useRef, useState } from "preact/hooks";

export interface Asked<T> {
  data?: T;
  error?: unknown;
  again: () => Promise<void>;
}

/** Asks once, and again every `every` ms if given; keeps the last answer while it fails. */
export function useAsk<T>(ask: () => Promise<T>, key: unknown, every?: number): Asked<T> {
  const [answer, set] = useState<{ key: unknown; data?: T; error?: unknown }>({ key });
  const latest = useRef(ask);
  latest.current = ask;
  const alive = useRef(0);
  const again = useCallback(async () => {
    const turn = ++alive.current;
    try {
      const data = await latest.current();
      if (turn === alive.current) set({ key, data });
    } catch (error) {
      if (turn === alive.current)
        set((before) => ({ key, data: before.key === key ? before.data : undefined, error }));
    }
  }, [key]);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    let stopped = false;
    const loop = async () => {
      await again();
      if (every && !stopped) timer = setTimeout(() => void loop(), every);
    };
    void loop();
    return () => {
      stopped = true;
      alive.current++;
      clearTimeout(timer);
    };
  }, [again, every]);
  return {
    data: answer.key === key ? answer.data : undefined,
    error: answer.key === key ? answer.error : undefined,
    again,
  };
}

/** The time, so that "3 s ago" stays true. */
export function useNow(every = 1000): number {
  const [now, set] = useState(Date.now());
  useEffect(() => {
    const timer = setInterval(() => set(Date.now()), every);
    return () => clearInterval(timer);
  }, [every]);
  return now;
}

/** Calls `draw` before each frame while the tab is seen. */
export function useFrames(draw: (now: number) => void): void {
  const latest = useRef(draw);
  latest.current = draw;
  useEffect(() => {
    let frame = requestAnimationFrame(function loop(now) {
      latest.current(now);
      frame = requestAnimationFrame(loop);
    });
    return () => cancelAnimationFrame(frame);
  }, []);
}

export function useTitle(title: string): void {
  useEffect(() => {
    document.title = `${title} · offbd`;
  }, [title]);
}
