/** The state and trace of one asset as they happen, over a WebSocket that comes back by itself. */
import { streamUrl } from "./access";
import type { FaultLine, State, Trace } from "./types";

export interface Told {
  state: State & { trace?: Trace };
  fault: FaultLine & { event: number };
  link: "live" | "lost";
}

export interface Teller {
  state?: (state: Told["state"]) => void;
  fault?: (fault: Told["fault"]) => void;
  link?: (link: Told["link"]) => void;
}

const RETRY_MS = [400, 5000] as const;

/** Silence after which a connection counts as lost: states come many times a second. */
const SILENCE_MS = 6000;

/** Follows `asset`, `hz` states a second; the answer stops it. */
export function follow(asset: string, hz: number, trace: boolean, teller: Teller): () => void {
  let socket: WebSocket | undefined;
  let wait: number = RETRY_MS[0];
  let after: number | undefined;
  let stopped = false;
  let heard = 0;
  let retry: ReturnType<typeof setTimeout> | undefined;

  const open = () => {
    const query = new URLSearchParams({ state: String(hz), trace: String(trace) });
    if (after !== undefined) query.set("after", String(after));
    const origin = location.origin.replace(/^http/, "ws");
    const current = new WebSocket(
      streamUrl(`${origin}/api/v1/assets/${encodeURIComponent(asset)}/stream?${query}`),
    );
    socket = current;
    heard = performance.now();
    current.onopen = () => {
      wait = RETRY_MS[0];
      teller.link?.("live");
    };
    current.onmessage = (message: MessageEvent<string>) => {
      heard = performance.now();
      const frame = JSON.parse(message.data) as { type: string };
      if (frame.type === "state") teller.state?.(frame as unknown as Told["state"]);
      if (frame.type === "fault") {
        const fault = frame as unknown as Told["fault"];
        after = fault.event;
        teller.fault?.(fault);
      }
    };
    current.onclose = () => {
      if (stopped || socket !== current) return;
      teller.link?.("lost");
      retry = setTimeout(open, wait);
      wait = Math.min(wait * 2, RETRY_MS[1]);
    };
  };

  const watchdog = setInterval(() => {
    if (socket?.readyState === WebSocket.OPEN && performance.now() - heard > SILENCE_MS) socket.close();
  }, 1000);
  open();
  return () => {
    stopped = true;
    clearInterval(watchdog);
    clearTimeout(retry);
    socket?.close();
  };
}
