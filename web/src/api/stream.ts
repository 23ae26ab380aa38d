/** The live state and trace of one asset, over a WebSocket that reconnects by itself, while the page is visible. */
import { streamUrl } from "./access";
import type { CommunicationEvent, FaultEvent } from "./events";
import type { State, Trace } from "./types";
import { whileVisible } from "./visibility";

export type StateFrame = State & { trace?: Trace };

export interface StreamListener {
  state?: (state: StateFrame) => void;
  fault?: (fault: FaultEvent) => void;
  /** Called when data of the rig stay away, and when they are back. */
  communication?: () => void;
  connection?: (state: "live" | "lost") => void;
}

type Frame =
  | ({ type: "state" } & StateFrame)
  | ({ type: "fault" } & FaultEvent)
  | ({ type: "communication" } & CommunicationEvent);

/** First and longest delay before a retry, ms. */
const RETRY_MS = [400, 5000] as const;

/** Time without a message after which a connection counts as lost, ms; states arrive many times per second. */
const SILENCE_MS = 6000;

/** Interval of the check for silence, ms. */
const CHECK_MS = 1000;

class RigStream {
  private socket?: WebSocket;
  private delay: number = RETRY_MS[0];
  private lastEvent?: number;
  private receivedAt = 0;
  private retry?: ReturnType<typeof setTimeout>;
  private watchdog?: ReturnType<typeof setInterval>;

  constructor(
    private readonly asset: string,
    private readonly statesPerSecond: number,
    private readonly listener: StreamListener,
  ) {}

  open(): void {
    this.watchdog = setInterval(() => this.closeIfSilent(), CHECK_MS);
    this.connect();
  }

  close(): void {
    clearInterval(this.watchdog);
    clearTimeout(this.retry);
    const { socket } = this;
    this.socket = undefined;
    if (socket) socket.onmessage = null;
    // The browser reports an error of the page if a socket is closed before it is open.
    if (socket?.readyState === WebSocket.CONNECTING) socket.onopen = () => socket.close();
    else socket?.close();
  }

  private address(): string {
    const query = new URLSearchParams({ state: String(this.statesPerSecond), trace: "true" });
    if (this.lastEvent !== undefined) query.set("after", String(this.lastEvent));
    const origin = location.origin.replace(/^http/, "ws");
    return streamUrl(`${origin}/api/v1/assets/${encodeURIComponent(this.asset)}/stream?${query}`);
  }

  private connect(): void {
    const socket = new WebSocket(this.address());
    this.socket = socket;
    this.receivedAt = performance.now();
    socket.onopen = () => {
      this.delay = RETRY_MS[0];
      this.listener.connection?.("live");
    };
    socket.onmessage = (message: MessageEvent<string>) => this.receive(JSON.parse(message.data) as Frame);
    socket.onclose = () => {
      if (this.socket !== socket) return;
      this.listener.connection?.("lost");
      this.retry = setTimeout(() => this.connect(), this.delay);
      this.delay = Math.min(this.delay * 2, RETRY_MS[1]);
    };
  }

  private receive(frame: Frame): void {
    this.receivedAt = performance.now();
    if (frame.type === "state") this.listener.state?.(frame);
    if (frame.type === "fault") {
      this.lastEvent = frame.event;
      this.listener.fault?.(frame);
    }
    if (frame.type === "communication") {
      this.lastEvent = frame.event;
      this.listener.communication?.();
    }
  }

  private closeIfSilent(): void {
    const isOpen = this.socket?.readyState === WebSocket.OPEN;
    if (isOpen && performance.now() - this.receivedAt > SILENCE_MS) this.socket?.close();
  }
}

/**
 * Streams `statesPerSecond` states of `asset` with their traces while the page is visible; returns a function that
 * closes the stream.
 */
export function followRig(asset: string, statesPerSecond: number, listener: StreamListener): () => void {
  const stream = new RigStream(asset, statesPerSecond, listener);
  return whileVisible(stream);
}
