/**
 * Adds the credentials of the caller: an HttpOnly cookie that the service sets at the login.
 * Requests and streams both send it.
 */
export function withCredentials(init: RequestInit): RequestInit {
  return { ...init, credentials: "same-origin" };
}

/** Returns the URL of a stream; a stream cannot send its own headers. */
export function streamUrl(path: string): string {
  return path;
}

const listeners = new Set<() => void>();

/** Calls `listener` on every response with status 401; returns a function that unsubscribes it. */
export function onUnauthenticated(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

/** Notifies the page that the caller is not authenticated, or no longer. */
export function announceUnauthenticated(): void {
  listeners.forEach((listener) => listener());
}

/** The user's name, recorded with an action if no token identifies the user. */
export function actor(): string {
  return localStorage.getItem("offbd.actor") || "dashboard";
}

export function rememberActor(name: string): void {
  if (name.trim()) localStorage.setItem("offbd.actor", name.trim());
}
