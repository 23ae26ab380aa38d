/** Client-side navigation: the path selects a view and changes without a reload. */
import { useLayoutEffect, useState } from "preact/hooks";

/** The event of a change by `navigate`; `popstate` reports only the back and forward buttons. */
const NAVIGATED = "offbd:navigated";

export function navigate(path: string, replace = false): void {
  history[replace ? "replaceState" : "pushState"](null, "", path);
  dispatchEvent(new Event(NAVIGATED));
}

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
  const segments = url.pathname.split("/").filter(Boolean).map(decodeURIComponent);
  return { segments, query: url.searchParams };
}
