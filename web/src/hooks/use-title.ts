import { useEffect } from "preact/hooks";

/** The view that is shown, and the number of alarms that need attention; empty if there are none. */
const shown = { title: "", number: "" };

function show(part: Partial<typeof shown>): void {
  Object.assign(shown, part);
  if (shown.title) document.title = titleText(shown.title, shown.number);
}

/** The title of the browser tab: (3) Sessions · offbd. */
export const titleText = (title: string, number: string) => `${number ? `(${number}) ` : ""}${title} · offbd`;

/** Sets the title of the browser tab. */
export function useTitle(title: string): void {
  useEffect(() => show({ title }), [title]);
}

/** Sets the number before the title: that of the badge in the header, on every view. */
export function useTitleNumber(number = ""): void {
  useEffect(() => show({ number }), [number]);
}
