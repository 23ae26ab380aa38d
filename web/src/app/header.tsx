import { useEffect, useRef, useState } from "preact/hooks";
import { fleetEvents, type ConnectionState } from "../api/events";
import { useOpenAlarms } from "../hooks/use-open-alarms";
import { useTitleNumber } from "../hooks/use-title";
import { LoggedIn } from "../parts/login/logged-in";
import { useRefusal } from "../parts/login/rights";
import { Link } from "../router/link";
import { lessonsPath, sessionsPath } from "../router/paths";
import { ThemeButton } from "./theme-button";

const CONNECTION: Record<ConnectionState, string> = {
  connecting: "connecting",
  live: "live",
  lost: "connection lost",
};

/** The links to the views, and whether each is the current view. */
function tabs([first, , third]: string[], isAdmin: boolean) {
  const isSetUp = first === "set-up" || third === "set-up";
  return [
    { to: "/", word: "Fleet", isHere: !first || (first === "rigs" && !isSetUp) },
    { to: "/alarms", word: "Alarms", isHere: first === "alarms" || first === "notifications" },
    { to: sessionsPath(), word: "Sessions", isHere: first === "sessions" || first === "jobs" },
    { to: "/set-up", word: "Set up", isHere: isSetUp },
    { to: lessonsPath(), word: "Lessons", isHere: first === "learn" },
    ...(isAdmin
      ? [{ to: "/administration", word: "Administration", isHere: first === "administration" }]
      : []),
  ];
}

/**
 * Scrolls to the link of the current view: on a phone not all links are on the screen. Not by
 * `scrollIntoView`, after which browsers let the Tab key go on from there.
 */
function showCurrent(nav: HTMLElement) {
  const link = nav.querySelector("[aria-current]")?.getBoundingClientRect();
  const { left, right } = nav.getBoundingClientRect();
  if (link) nav.scrollLeft += Math.max(link.right - right, 0) - Math.max(left - link.left, 0);
}

/** The header of every view. */
export function Header({ segments }: { segments: string[] }) {
  const [connection, setConnection] = useState(fleetEvents.state);
  useEffect(() => fleetEvents.watch(setConnection), []);
  // Every view shows the state of the connection, so it is open on all of them.
  useEffect(() => fleetEvents.listen(() => {}), []);
  const isAdmin = useRefusal("admin") === undefined;
  const openAlarms = useOpenAlarms();
  useTitleNumber(openAlarms);
  const [first] = segments;
  const nav = useRef<HTMLElement>(null);
  useEffect(() => showCurrent(nav.current!), [first]);
  return (
    <header class="top">
      <Link to="/" class="brand">
        <img src="/icon.svg" alt="" width="24" height="24" />
        offbd
      </Link>
      <nav aria-label="Views" ref={nav}>
        {tabs(segments, isAdmin).map(({ to, word, isHere }) => (
          <Link to={to} aria-current={isHere ? "page" : undefined}>
            {word}
            {to === "/alarms" && openAlarms && (
              <>
                {" "}
                <span class="badge" title="Failing and unacknowledged">
                  {openAlarms}
                </span>
              </>
            )}
          </Link>
        ))}
      </nav>
      <span class={`link-state link-${connection}`} role="status">
        {CONNECTION[connection]}
      </span>
      <LoggedIn />
      <ThemeButton />
    </header>
  );
}
