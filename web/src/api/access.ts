/**
 * The one place that knows how a request proves who sends it. The service has
 * no log-in today, so nothing is added; a token or a cookie would be kept, added
 * and renewed here, for requests and for streams alike.
 */
export function authorised(init: RequestInit): RequestInit {
  return { ...init, credentials: "same-origin" };
}

/** The address of a stream, which cannot carry headers. */
export function streamUrl(path: string): string {
  return path;
}

/** What a person who acts is called; kept with the act. */
export function actor(): string {
  return localStorage.getItem("offbd.actor") || "dashboard";
}

export function rememberActor(name: string): void {
  if (name.trim()) localStorage.setItem("offbd.actor", name.trim());
}
