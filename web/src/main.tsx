/** The page's frame: what is on top, and which view the address asks for. */
import { render } from "preact";
import { useEffect, useState } from "preact/hooks";
import { api } from "./api/client";
import { events, type Link as Connection } from "./api/events";
import { useAsk } from "./hooks";
import { Empty, Loading } from "./parts/bits";
import { Door, Leave } from "./parts/door";
import { lazy, Suspense } from "./parts/lazy";
import { Link, usePlace } from "./router";
import { setTheme, theme, type Theme } from "./theme";
import "./style.css";
import { FleetPage } from "./pages/fleet";

const AssetPage = lazy(() => import("./pages/asset").then((m) => m.AssetPage));
const FaultPage = lazy(() => import("./pages/fault").then((m) => m.FaultPage));
const SessionsPage = lazy(() => import("./pages/sessions").then((m) => m.SessionsPage));
const SessionPage = lazy(() => import("./pages/session").then((m) => m.SessionPage));
const SetUpPage = lazy(() => import("./pages/set-up").then((m) => m.SetUpPage));
const LearnPage = lazy(() => import("./pages/learn").then((m) => m.LearnPage));

function view(parts: string[], demo: boolean) {
  const [first, name, second, code] = parts;
  if (!first) return <FleetPage />;
  if (first === "rigs" && name && !second) return <AssetPage name={name} />;
  if (first === "rigs" && name && second === "faults" && code) return <FaultPage name={name} code={code} />;
  if (first === "rigs" && name && second === "set-up") return <SetUpPage key={name} name={name} />;
  if (first === "set-up") return <SetUpPage />;
  if (first === "sessions" && name) return <SessionPage key={name} id={name} />;
  if (first === "sessions") return <SessionsPage />;
  if (first === "learn") return <LearnPage demo={demo} />;
  return (
    <main>
      <Empty title="There is nothing here">
        <p>
          <Link to="/">To the fleet</Link>
        </p>
      </Empty>
    </main>
  );
}

const TITLES: Record<Connection, string> = {
  connecting: "connecting",
  live: "live",
  lost: "connection lost",
};
const THEMES: Record<Theme, { next: Theme; sign: string }> = {
  system: { next: "light", sign: "◐" },
  light: { next: "dark", sign: "☀" },
  dark: { next: "system", sign: "☾" },
};

function Frame() {
  const { parts } = usePlace();
  const [link, setLink] = useState<Connection>(events.link);
  const [chosen, setChosen] = useState(theme());
  const health = useAsk(api.health, "health");
  useEffect(() => events.watch(setLink), []);
  useEffect(() => events.listen(() => {}), []);
  const demo = health.data?.demo ?? false;
  const tabs: [string, string, boolean][] = [
    ["/", "Fleet", !parts[0] || (parts[0] === "rigs" && parts[2] !== "set-up")],
    ["/sessions", "Sessions", parts[0] === "sessions"],
    ["/set-up", "Set up", parts[0] === "set-up" || parts[2] === "set-up"],
    ["/learn", demo ? "Demo" : "Learn", parts[0] === "learn"],
  ];
  const switchTheme = () => {
    setTheme(THEMES[chosen].next);
    setChosen(THEMES[chosen].next);
  };
  return (
    <>
      <a class="skip" href="#content">
        Skip to the content
      </a>
      <header class="top">
        <Link to="/" class="brand">
          <img src="/icon.svg" alt="" width="24" height="24" />
          offbd
        </Link>
        <nav aria-label="Views">
          {tabs.map(([to, word, here]) => (
            <Link to={to} aria-current={here ? "page" : undefined}>
              {word}
            </Link>
          ))}
        </nav>
        <span class={`link-state link-${link}`} role="status">
          {TITLES[link]}
        </span>
        <Leave />
        <button
          type="button"
          class="small"
          onClick={switchTheme}
          aria-label={`Colours: ${chosen}; change`}
          title={`Colours: ${chosen}`}
        >
          {THEMES[chosen].sign}
        </button>
      </header>
      <div id="content" tabIndex={-1}>
        <Suspense
          fallback={
            <main>
              <Loading what="the view" />
            </main>
          }
        >
          {view(parts, demo)}
        </Suspense>
      </div>
      <footer>
        <a href="/docs/">Interface</a>
        <a href="/openapi.yaml">openapi.yaml</a>
        <a href="/metrics">Metrics</a>
        <span class="quiet">offbd {health.data?.version}</span>
      </footer>
    </>
  );
}

render(
  <Door>
    <Frame />
  </Door>,
  document.getElementById("app")!,
);
