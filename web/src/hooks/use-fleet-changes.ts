import { useEffect } from "preact/hooks";
import { fleetEvents } from "../api/events";
import { useLatest } from "./use-latest";

/** Delay between an event and the action, ms: events come in groups. */
const GROUP_MS = 500;

/** Calls `action` after events of the fleet, once for those that come together. */
export function useFleetChanges(action: () => unknown): void {
  const latest = useLatest(action);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout> | undefined;
    const stop = fleetEvents.listen(() => {
      timer ??= setTimeout(() => {
        timer = undefined;
        latest.current();
      }, GROUP_MS);
    });
    return () => {
      stop();
      clearTimeout(timer);
    };
  }, [latest]);
}
