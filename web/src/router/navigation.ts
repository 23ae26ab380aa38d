/** The page's own addresses: a path picks a view, and changes without loading the page anew. */
import { useLayoutEffect, useState } from "preact/hooks";

/** The event by which `navigate` tells that the address has changed; the browser's own tells of "back" alone. */
const NAVIGATED = "offbd:navigated";

export function navigate(path: string, replace = false): void {
  history[replace ? "replaceState" : "pushState"](null, "", path);
  dispatchEvent(new Event(NAVIGATED));
}

/** Where the page is: its path in decoded segments, and its query. */
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
  const segments = url.pathname.split("/").filter(Boolean).map(decodeURIComponent);
  return { segments, query: url.searchParams };
}
