import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { FaultEvent } from "../api/events";
import { followRig } from "../api/stream";
import type { State, Trace } from "../api/types";
import { TraceBuffer } from "../live/buffer";
import { useLatest } from "./use-latest";

interface Options {
  statesPerSecond: number;
  /** Shortest interval between two renderings, ms; the buffer receives every sample regardless. */
  renderInterval?: number;
  newSession?: () => void;
  fault?: (line: FaultEvent) => void;
  communication?: () => void;
}

/** The live state of a rig, and the trace of its session in a buffer, which does not cause renderings. */
export function useRigStream(name: string, options: Options) {
  const { statesPerSecond, renderInterval = 0 } = options;
  const buffer = useMemo(() => new TraceBuffer(), []);
  const [state, setState] = useState<State>();
  const [connection, setConnection] = useState<"live" | "lost">();
  /** The last received sample, and the time of its arrival, ms since 1970. */
  const lastSample = useRef({ at: 0, t_s: -1, session: "" });
  const latest = useLatest(options);
  useEffect(() => {
    let renderedAt = -Infinity;
    /** Whether nothing of the trace has come over this connection yet. */
    let isNew = true;
    const take = (trace: Trace) => {
      if (!trace.t_s.length) return;
      if (isNew) buffer.resume(trace);
      else buffer.append(trace);
      isNew = false;
    };
    return followRig(name, statesPerSecond, {
      connection: (next) => {
        isNew = true;
        setConnection(next);
      },
      state: (frame) => {
        const session = frame.session_id ?? "";
        if (session !== lastSample.current.session) {
          lastSample.current.session = session;
          buffer.clear();
          latest.current.newSession?.();
        }
        if (frame.trace) take(frame.trace);
        if (frame.t_s != null && frame.t_s !== lastSample.current.t_s)
          Object.assign(lastSample.current, { t_s: frame.t_s, at: Date.now() });
        if (performance.now() - renderedAt < renderInterval) return;
        renderedAt = performance.now();
        setState(frame);
      },
      fault: (line) => latest.current.fault?.(line),
      communication: () => latest.current.communication?.(),
    });
  }, [name, statesPerSecond, renderInterval, buffer, latest]);
  /** Whether no sample has arrived for `limit` ms before `now`. */
  const isSilent = (now: number, limit: number) => now - lastSample.current.at >= limit;
  return { state, buffer, connection, isSilent };
}

export type RigStream = ReturnType<typeof useRigStream>;
