/**
 * Fault events of the whole fleet, over one connection for the whole page. After
 * a loss it is opened anew from the last event seen, so that none is missed.
 */
import { streamUrl } from "./access";
import type { FaultLine } from "./types";

export type ConnectionState = "connecting" | "live" | "lost";

export type FaultEvent = FaultLine & { event: number };

/** First and longest wait before another attempt. */
const RETRY_MS = [500, 5000] as const;

class FaultEvents {
  private source?: EventSource;
  private lastEvent?: number;
  private wait: number = RETRY_MS[0];
  private listeners = new Set<(line: FaultEvent) => void>();
  private watchers = new Set<(state: ConnectionState) => void>();
  state: ConnectionState = "connecting";

  /** Calls `listener` with every event from now on; the answer ends that. */
  listen(listener: (line: FaultEvent) => void): () => void {
    this.listeners.add(listener);
    if (!this.source) this.open();
    return () => this.listeners.delete(listener);
  }

  /** Calls `watcher` with the state of the connection, now and whenever it changes. */
  watch(watcher: (state: ConnectionState) => void): () => void {
    this.watchers.add(watcher);
    watcher(this.state);
    return () => this.watchers.delete(watcher);
  }

  /**
   * An EventSource reconnects by itself after a connection that broke, but gives up for good on
   * an answer that is no stream, as a proxy's 502 while the service restarts, or a 401 before
   * somebody logs in. So it is closed on any error, and opened anew here.
   */
  private open() {
    const after = this.lastEvent === undefined ? "" : `?after=${this.lastEvent}`;
    const source = (this.source = new EventSource(streamUrl(`/api/v1/events${after}`)));
    source.onopen = () => {
      this.wait = RETRY_MS[0];
      this.setState("live");
    };
    source.onerror = () => {
      source.close();
      this.setState("lost");
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(this.wait * 2, RETRY_MS[1]);
    };
    source.addEventListener("begin", (message) => (this.lastEvent = Number(message.lastEventId)));
    source.addEventListener("fault", (message: MessageEvent<string>) => {
      this.lastEvent = Number(message.lastEventId);
      const line = { ...(JSON.parse(message.data) as FaultLine), event: this.lastEvent };
      this.listeners.forEach((listener) => listener(line));
    });
  }

  private setState(state: ConnectionState) {
    if (this.state === state) return;
    this.state = state;
    this.watchers.forEach((watcher) => watcher(state));
  }
}

export const faultEvents = new FaultEvents();
