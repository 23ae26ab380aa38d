import { api } from "../api/client";
import { useEffect, useState } from "preact/hooks";
import { Loading } from "./loading";

/** Interval of the check whether the service answers, ms. */
const CHECK_MS = 2000;

/**
 * The message if the code of a view could not be loaded. While the service does not answer, the page waits for it
 * and loads again by itself; otherwise the service has been updated since the page was opened.
 */
export function LoadFailed() {
  const [isDown, setDown] = useState<boolean>();
  useEffect(() => {
    let wasDown = false;
    const check = () =>
      api.health().then(
        () => (wasDown ? location.reload() : setDown(false)),
        () => {
          wasDown = true;
          setDown(true);
        },
      );
    void check();
    const timer = setInterval(() => void check(), CHECK_MS);
    return () => clearInterval(timer);
  }, []);
  if (isDown === undefined)
    return (
      <main>
        <Loading what="the page" />
      </main>
    );
  return (
    <main>
      <p class="trouble" role="alert">
        {isDown
          ? "The service does not answer. This page is loaded as soon as it does."
          : "This part of the page could not be loaded: the service may have been updated."}{" "}
        <button type="button" onClick={() => location.reload()}>
          Reload the page
        </button>
      </p>
    </main>
  );
}
