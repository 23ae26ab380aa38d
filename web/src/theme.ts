/** Light, dark, or as the system has it; and the colours that pictures on canvas need. */

export type Theme = "system" | "light" | "dark";

const KEY = "offbd.theme";
const listeners = new Set<() => void>();
/** Asked for in every frame, changed by the theme alone. */
const known = new Map<string, string>();

export const theme = () => (localStorage.getItem(KEY) ?? "system") as Theme;

export function setTheme(wanted: Theme): void {
  localStorage.setItem(KEY, wanted);
  apply();
}

function apply(): void {
  const wanted = theme();
  document.documentElement.style.colorScheme = wanted === "system" ? "light dark" : wanted;
  document.documentElement.dataset.theme = isDark() ? "dark" : "light";
  known.clear();
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

/** The value of a custom property of the style sheet, as the theme has it now. */
export function colour(name: string): string {
  let value = known.get(name);
  if (value === undefined) {
    value = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
    known.set(name, value);
  }
  return value;
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", apply);
apply();
