import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { FaultEvent } from "../api/events";
import { followRig } from "../api/stream";
import type { State } from "../api/types";
import { TraceBuffer } from "../live/buffer";
import { useLatest } from "./use-latest";

interface Options {
  statesPerSecond: number;
  /** Shortest time between two renderings, ms: the buffer has every sample all the same. */
  renderInterval?: number;
  newSession?: () => void;
  fault?: (line: FaultEvent) => void;
}

/** A rig as it happens: its state, and the trace of its session in a buffer that is not rendered. */
export function useRigStream(name: string, options: Options) {
  const { statesPerSecond, renderInterval = 0 } = options;
  const buffer = useMemo(() => new TraceBuffer(), []);
  const [state, setState] = useState<State>();
  const [connection, setConnection] = useState<"live" | "lost">();
  /** When the last sample came, ms since 1970, and which it was. */
  const heard = useRef({ at: 0, t_s: -1, session: "" });
  const latest = useLatest(options);
  useEffect(() => {
    let renderedAt = -Infinity;
    return followRig(name, statesPerSecond, {
      connection: setConnection,
      state: (frame) => {
        const session = frame.session_id ?? "";
        if (session !== heard.current.session) {
          heard.current.session = session;
          buffer.clear();
          latest.current.newSession?.();
        }
        if (frame.trace) buffer.append(frame.trace);
        if (frame.t_s != null && frame.t_s !== heard.current.t_s)
          Object.assign(heard.current, { t_s: frame.t_s, at: Date.now() });
        if (performance.now() - renderedAt < renderInterval) return;
        renderedAt = performance.now();
        setState(frame);
      },
      fault: (line) => latest.current.fault?.(line),
    });
  }, [name, statesPerSecond, renderInterval, buffer, latest]);
  /** Whether no sample has come for `limit` ms before `now`. */
  const isSilent = (now: number, limit: number) => now - heard.current.at >= limit;
  return { state, buffer, connection, isSilent };
}

export type RigStream = ReturnType<typeof useRigStream>;
