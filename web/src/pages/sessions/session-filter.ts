/** The filter of the list of sessions in the address. */
import type { SessionQuery } from "../../api/types";

/** The parameters of the address. */
export type SessionKey = "asset" | "tag" | "name" | "verdict" | "from" | "to" | "sort";

/** A day as the field of a date gives it, such as 2026-03-01. */
const DAY = /^(\d{4})-(\d\d)-(\d\d)$/;

/** Returns the moment at which the local day begins, or `days` later; undefined if it is not a day. */
function startOf(day: string, days = 0): string | undefined {
  const [, year, month, date] = DAY.exec(day) ?? [];
  const start = new Date(Number(year), Number(month) - 1, Number(date) + days);
  return Number.isNaN(start.getTime()) ? undefined : start.toISOString();
}

/** One of `words`, or undefined. */
const oneOf = <T extends string>(words: readonly T[], word: string | null) =>
  words.find((each) => each === word);

/** Returns what the service is asked for by an address. `from` and `to` are days, both included. */
export function sessionQuery(address: URLSearchParams): SessionQuery {
  const word = (key: SessionKey) => address.get(key) || undefined;
  return {
    asset: word("asset"),
    tag: word("tag"),
    name: word("name"),
    verdict: oneOf(["fault", "no_fault"], address.get("verdict")),
    opened_from: startOf(word("from") ?? ""),
    opened_to: startOf(word("to") ?? "", 1),
    sort: oneOf(["opened_at"], address.get("sort")),
  };
}

/** Whether an address selects sessions, and does not only order them. */
export const isFiltered = (filter: SessionQuery) =>
  Object.values({ ...filter, sort: undefined }).some((value) => value !== undefined);
