/** Named filters of a list: kept in the browser, each the query of an address. */
export interface SavedView {
  name: string;
  /** The query without its question mark; empty for the whole list. */
  query: string;
}

/** Number of views that a list keeps; a further one replaces the oldest. */
const MAX_VIEWS = 50;

/** Longest name, characters; a longer one is cut. */
export const MAX_VIEW_NAME = 60;

const isView = (value: unknown): value is SavedView =>
  typeof (value as SavedView | null)?.name === "string" && typeof (value as SavedView).query === "string";

/** Reads what the browser has kept; what is not a view is left out. */
export function parseViews(text: string | null): SavedView[] {
  try {
    const kept: unknown = JSON.parse(text ?? "[]");
    return Array.isArray(kept) ? kept.filter(isView) : [];
  } catch {
    return [];
  }
}

const tidy = (name: string) => name.trim().slice(0, MAX_VIEW_NAME);

/** Returns the views with a new one; one of the same name is replaced. */
export function withView(views: SavedView[], name: string, query: string): SavedView[] {
  const view = { name: tidy(name), query };
  if (!view.name) return views;
  const isKnown = views.some((known) => known.name === view.name);
  if (isKnown) return views.map((known) => (known.name === view.name ? view : known));
  return [...views, view].slice(-MAX_VIEWS);
}

/** Returns the views with another name for one; as they are if the name is empty or taken. */
export function renamed(views: SavedView[], from: string, to: string): SavedView[] {
  const name = tidy(to);
  if (!name || views.some((view) => view.name === name)) return views;
  return views.map((view) => (view.name === from ? { ...view, name } : view));
}

/** Returns the views without one. */
export const withoutView = (views: SavedView[], name: string) => views.filter((view) => view.name !== name);
