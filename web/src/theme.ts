/** The theme (light, dark, or that of the system), and its colours for drawings on a canvas. */

export type Theme = "system" | "light" | "dark";

const KEY = "offbd.theme";
const listeners = new Set<() => void>();
/** Cached colours: they are read in every frame and change only with the theme. */
const cache = new Map<string, string>();

export const theme = () => (localStorage.getItem(KEY) ?? "system") as Theme;

export function setTheme(wanted: Theme): void {
  localStorage.setItem(KEY, wanted);
  apply();
}

function apply(): void {
  const wanted = theme();
  document.documentElement.style.colorScheme = wanted === "system" ? "light dark" : wanted;
  document.documentElement.dataset.theme = isDark() ? "dark" : "light";
  cache.clear();
  listeners.forEach((listener) => listener());
}

export function isDark(): boolean {
  const wanted = theme();
  return wanted === "system" ? matchMedia("(prefers-color-scheme: dark)").matches : wanted === "dark";
}

export function onTheme(listener: () => void): () => void {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

/** Returns the value of a custom property of the style sheet in the current theme. */
export function colour(name: string): string {
  let value = cache.get(name);
  if (value === undefined) {
    value = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    cache.set(name, value);
  }
  return value;
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
apply();
