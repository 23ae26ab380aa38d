/**
 * Fault events of the whole fleet, over one connection for the whole page. After
 * a loss it is opened anew from the last event seen, so that none is missed.
 */
import { streamUrl } from "./access";
import type { FaultLine } from "./types";

export type Link = "connecting" | "live" | "lost";

type Listener = (line: FaultLine & { event: number }) => void;

/** First and longest wait before another attempt. */
const RETRY_MS = [500, 5000] as const;

class Events {
  private source?: EventSource;
  private last?: number;
  private wait: number = RETRY_MS[0];
  private listeners = new Set<Listener>();
  private watchers = new Set<(link: Link) => void>();
  link: Link = "connecting";

  listen(listener: Listener): () => void {
    this.listeners.add(listener);
    if (!this.source) this.open();
    return () => this.listeners.delete(listener);
  }

  watch(watcher: (link: Link) => void): () => void {
    this.watchers.add(watcher);
    watcher(this.link);
    return () => this.watchers.delete(watcher);
  }

  private open() {
    const after = this.last === undefined ? "" : `?after=${this.last}`;
    const source = (this.source = new EventSource(streamUrl(`/api/v1/events${after}`)));
    source.onopen = () => {
      this.wait = RETRY_MS[0];
      this.set("live");
    };
    source.onerror = () => {
      source.close();
      this.set("lost");
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(this.wait * 2, RETRY_MS[1]);
    };
    source.addEventListener("begin", (message) => (this.last = Number(message.lastEventId)));
    source.addEventListener("fault", (message: MessageEvent<string>) => {
      this.last = Number(message.lastEventId);
      const line = { ...(JSON.parse(message.data) as FaultLine), event: this.last };
      this.listeners.forEach((listener) => listener(line));
    });
  }

  private set(link: Link) {
    if (this.link === link) return;
    this.link = link;
    this.watchers.forEach((watcher) => watcher(link));
  }
}

export const events = new Events();
