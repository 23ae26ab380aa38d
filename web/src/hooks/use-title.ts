import { useEffect } from "preact/hooks";

/** A title after the number of what needs attention, if any does: (3) Alarms. `isMore` says that there are more. */
export const withNumber = (title: string, n: number, isMore = false) =>
  n ? `(${n}${isMore ? "+" : ""}) ${title}` : title;

/** Sets the title of the browser tab. */
export function useTitle(title: string): void {
  useEffect(() => {
    document.title = `${title} · offbd`;
  }, [title]);
}
