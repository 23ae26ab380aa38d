/**
 * Keeps long-lived connections only while the page can be seen. Over HTTP/1.1 a browser has six connections to a
 * service, for all its tabs together: tabs in the background, and pages that the browser keeps for its Back
 * button, would take those that the others need.
 */

/** Time for which a hidden page keeps its connections, ms, so that a glance at another tab costs nothing. */
const KEPT_MS = 1000;

interface Connection {
  open: () => void;
  close: () => void;
}

const connections = new Set<Connection>();
let isShown = false;
let leaving: ReturnType<typeof setTimeout> | undefined;

function show() {
  clearTimeout(leaving);
  if (isShown) return;
  isShown = true;
  connections.forEach((connection) => connection.open());
}

function leave() {
  clearTimeout(leaving);
  if (!isShown) return;
  isShown = false;
  connections.forEach((connection) => connection.close());
}

function changeVisibility() {
  clearTimeout(leaving);
  if (document.visibilityState === "visible") show();
  else leaving = setTimeout(leave, KEPT_MS);
}

/** Follows the page from the first connection on. */
function followPage() {
  isShown = document.visibilityState === "visible";
  document.addEventListener("visibilitychange", changeVisibility);
  // A page that is left may be kept with all it has, and no timer runs there.
  addEventListener("pagehide", leave);
  addEventListener("pageshow", changeVisibility);
}

let isFollowed = false;

/**
 * Opens a connection while the page is visible and closes it while it is not; returns a function that closes it
 * for good. `open` and `close` are called in turns.
 */
export function whileVisible(connection: Connection): () => void {
  if (!isFollowed) followPage();
  isFollowed = true;
  connections.add(connection);
  if (isShown) connection.open();
  return () => {
    if (connections.delete(connection) && isShown) connection.close();
  };
}
