/** The filter of the list of alarms in the address. */
import type { AlarmFilter } from "../../api/alarms";

/** The parameters of the address. */
export type AlarmKey = "state" | "code" | "rig" | "tag" | "hours" | "acknowledged" | "sort" | "group";

const MINUTE_MS = 60_000;
const HOUR_MS = 60 * MINUTE_MS;

/** The start of the last `hours`, rounded to minutes. */
const since = (hours: number, now: number) =>
  new Date(Math.floor(now / MINUTE_MS) * MINUTE_MS - hours * HOUR_MS).toISOString();

/** Returns the filter of the service for an address at the time `now`, ms since 1970. */
export function alarmFilter(query: URLSearchParams, now: number): AlarmFilter {
  const word = (key: AlarmKey) => query.get(key) || undefined;
  const hours = Number(word("hours"));
  return {
    state: word("state") ?? "active",
    code: word("code"),
    tag: word("tag"),
    from: hours > 0 && Number.isFinite(hours) ? since(hours, now) : undefined,
    acknowledged: word("acknowledged") === "false" ? false : undefined,
  };
}
