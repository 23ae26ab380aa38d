/** Client-side navigation: the path selects a view and changes without a reload. */
import { useLayoutEffect, useState } from "preact/hooks";

/** The event of a change by `navigate`; `popstate` reports only the back and forward buttons. */
const NAVIGATED = "offbd:navigated";

export function navigate(path: string, replace = false): void {
  history[replace ? "replaceState" : "pushState"](null, "", path);
  dispatchEvent(new Event(NAVIGATED));
}

/** Remembers with the present address how far the page is scrolled, for the way back. */
export function rememberScroll(): void {
  history.replaceState({ scroll: scrollY }, "");
}

/** How far the page at this address was scrolled when it was left, px; undefined if it is new. */
export const rememberedScroll = () => (history.state as { scroll?: number } | null)?.scroll;

/** Returns the decoded segments of a path. */
export const segmentsOf = (path: string) => path.split("/").filter(Boolean).map(decodeURIComponent);

/** The current address: the decoded segments of its path, and its query. */
export function useLocation(): { segments: string[]; query: URLSearchParams } {
  const [address, setAddress] = useState(location.pathname + location.search);
  useLayoutEffect(() => {
    const changed = () => setAddress(location.pathname + location.search);
    addEventListener("popstate", changed);
    addEventListener(NAVIGATED, changed);
    return () => {
      removeEventListener("popstate", changed);
      removeEventListener(NAVIGATED, changed);
    };
  }, []);
  const url = new URL(address, location.origin);
  return { segments: segmentsOf(url.pathname), query: url.searchParams };
}
