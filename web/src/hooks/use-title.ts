import { useEffect } from "preact/hooks";

/** Gives the browser's tab the title of a page. */
export function useTitle(title: string): void {
  useEffect(() => {
    document.title = `${title} · offbd`;
  }, [title]);
}
