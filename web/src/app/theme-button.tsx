import { useState } from "preact/hooks";
import { setTheme, theme, type Theme } from "../theme";

const THEMES: Record<Theme, { next: Theme; symbol: string }> = {
  system: { next: "light", symbol: "◐" },
  light: { next: "dark", symbol: "☀" },
  dark: { next: "system", symbol: "☾" },
};

/** Switches between the system's colours, the light theme and the dark theme. */
export function ThemeButton() {
  const [chosen, setChosen] = useState(theme());
  const { next, symbol } = THEMES[chosen];
  const change = () => {
    setTheme(next);
    setChosen(next);
  };
  return (
    <button
      type="button"
      class="small"
      onClick={change}
      aria-label={`Colours: ${chosen}; change`}
      title={`Colours: ${chosen}`}
    >
      {symbol}
    </button>
  );
}
