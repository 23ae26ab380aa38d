/**
 * Events of the whole fleet, of faults and of data that stay away, over one connection for the whole page.
 * After a lost connection, and when a hidden page is visible again, the stream resumes after the last received event.
 */
import { streamUrl } from "./access";
import type { CommunicationLine, FaultLine } from "./types";
import { whileVisible } from "./visibility";

export type ConnectionState = "connecting" | "live" | "lost";

export type FaultEvent = FaultLine & { event: number };

/** Data of a rig stay away, or are back. */
export type CommunicationEvent = CommunicationLine & { event: number };

export type FleetEvent = FaultEvent | CommunicationEvent;

export const isCommunication = <T extends FaultLine | CommunicationLine>(
  line: T,
): line is Extract<T, CommunicationLine> => line.type === "communication";

/** The types of the stream's messages that are events of a rig. */
const TYPES = ["fault", "communication"];

/** First and longest delay before a retry, ms. */
const RETRY_MS = [500, 5000] as const;

class FleetEvents {
  private source?: EventSource;
  private retry?: ReturnType<typeof setTimeout>;
  private isFollowed = false;
  private lastEvent?: number;
  private delay: number = RETRY_MS[0];
  private listeners = new Set<(line: FleetEvent) => void>();
  private watchers = new Set<(state: ConnectionState) => void>();
  state: ConnectionState = "connecting";

  /** Calls `listener` with every event from now on; returns a function that unsubscribes it. */
  listen(listener: (line: FleetEvent) => void): () => void {
    this.listeners.add(listener);
    if (!this.isFollowed) whileVisible({ open: () => this.open(), close: () => this.close() });
    this.isFollowed = true;
    return () => this.listeners.delete(listener);
  }

  /**
   * Calls `watcher` with the state of the connection, now and at every change; returns a
   * function that unsubscribes it.
   */
  watch(watcher: (state: ConnectionState) => void): () => void {
    this.watchers.add(watcher);
    watcher(this.state);
    return () => this.watchers.delete(watcher);
  }

  /**
   * An EventSource reconnects by itself after a broken connection, but gives up on a response
   * that is not a stream, such as a proxy's 502 while the service restarts, or a 401 before the
   * login. So it is closed on any error and opened again here.
   */
  private open() {
    const after = this.lastEvent === undefined ? "" : `?after=${this.lastEvent}`;
    const source = (this.source = new EventSource(streamUrl(`/api/v1/events${after}`)));
    source.onopen = () => {
      this.delay = RETRY_MS[0];
      this.setState("live");
    };
    source.onerror = () => {
      source.close();
      this.setState("lost");
      this.retry = setTimeout(() => this.open(), this.delay);
      this.delay = Math.min(this.delay * 2, RETRY_MS[1]);
    };
    source.addEventListener("begin", (message) => (this.lastEvent = Number(message.lastEventId)));
    const receive = (message: MessageEvent<string>) => {
      this.lastEvent = Number(message.lastEventId);
      const line = { ...(JSON.parse(message.data) as FleetEvent), event: this.lastEvent };
      this.listeners.forEach((listener) => listener(line));
    };
    TYPES.forEach((type) => source.addEventListener(type, receive));
  }

  /** Closes the stream of a hidden page. A closed source delivers nothing more, so `lastEvent` is final. */
  private close() {
    clearTimeout(this.retry);
    this.source?.close();
  }

  private setState(state: ConnectionState) {
    if (this.state === state) return;
    this.state = state;
    this.watchers.forEach((watcher) => watcher(state));
  }
}

export const fleetEvents = new FleetEvents();
