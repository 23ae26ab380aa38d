/** The page's own addresses: a path picks a view, links change it without loading anew. */
import type { ComponentChildren } from "preact";
import { useLayoutEffect, useState } from "preact/hooks";

const CHANGED = "offbd:moved";

export function go(path: string, replace = false): void {
  history[replace ? "replaceState" : "pushState"](null, "", path);
  dispatchEvent(new Event(CHANGED));
}

/** Where the page is: its path in parts, decoded, and its query. */
export function usePlace(): { parts: string[]; query: URLSearchParams; path: string } {
  const [path, set] = useState(location.pathname + location.search);
  useLayoutEffect(() => {
    const moved = () => set(location.pathname + location.search);
    addEventListener("popstate", moved);
    addEventListener(CHANGED, moved);
    return () => {
      removeEventListener("popstate", moved);
      removeEventListener(CHANGED, moved);
    };
  }, []);
  const url = new URL(path, location.origin);
  const parts = url.pathname.split("/").filter(Boolean).map(decodeURIComponent);
  return { parts, query: url.searchParams, path: url.pathname };
}

export const at = (...parts: string[]) => `/${parts.map(encodeURIComponent).join("/")}`;

type LinkProps = { to: string; children: ComponentChildren; class?: string; "aria-current"?: "page" };

export function Link({ to, children, ...rest }: LinkProps) {
  const follow = (event: MouseEvent) => {
    const plain = event.button === 0 && !event.metaKey && !event.ctrlKey && !event.shiftKey && !event.altKey;
    if (!plain) return;
    event.preventDefault();
    go(to);
    scrollTo(0, 0);
  };
  return (
    <a href={to} onClick={follow} {...rest}>
      {children}
    </a>
  );
}
