import { useState } from "preact/hooks";
import { parseViews, type SavedView } from "./views";

/** The views of the list at the address `page`, kept in the browser. */
export function useSavedViews(page: string): [SavedView[], (views: SavedView[]) => void] {
  const key = `offbd.views ${page}`;
  const [views, setViews] = useState(() => parseViews(localStorage.getItem(key)));
  const keep = (next: SavedView[]) => {
    localStorage.setItem(key, JSON.stringify(next));
    setViews(next);
  };
  return [views, keep];
}
