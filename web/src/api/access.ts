/**
 * The one place that knows how a request proves who sends it: by a cookie that
 * the service gives for a token and no script can read. It goes along with
 * requests and with streams alike.
 */
export function withCredentials(init: RequestInit): RequestInit {
  return { ...init, credentials: "same-origin" };
}

/** The address of a stream, which cannot carry headers. */
export function streamUrl(path: string): string {
  return path;
}

const listeners = new Set<() => void>();

/** Calls `listener` whenever the service does not know who asks; the answer ends that. */
export function onUnauthenticated(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

/** Tells the page that the service does not know who asks, or no longer. */
export function announceUnauthenticated(): void {
  listeners.forEach((listener) => listener());
}

/** What a person who acts is called; kept with the act where no token says it. */
export function actor(): string {
  return localStorage.getItem("offbd.actor") || "dashboard";
}

export function rememberActor(name: string): void {
  if (name.trim()) localStorage.setItem("offbd.actor", name.trim());
}
