/** HTTP requests to the service. An error response is thrown as a `ProblemError` with its detail. */
import { problemWords } from "../words/problem";
import { announceUnauthenticated, withCredentials } from "./access";
import type { Page, Problem } from "./types";

export const BASE = "/api/v1";
export const LOGIN = `${BASE}/login`;

/** Default timeout of a request, ms; an import sets its own. */
const TIMEOUT_MS = 70_000;

export class ProblemError extends Error {
  constructor(
    readonly status: number,
    readonly problem: Partial<Problem>,
  ) {
    super(problem.detail ?? problem.title ?? `The service answered with status ${status}.`);
  }
}

/** Returns the error for an unsuccessful response. */
export async function failure(response: Response): Promise<ProblemError> {
  const problem = (await response.json().catch(() => ({}))) as Partial<Problem>;
  return new ProblemError(response.status, problem);
}

/** Whether the service requires a valid token. */
export const isUnauthenticated = (error: unknown) => error instanceof ProblemError && error.status === 401;

/** Whether what was asked for does not exist. */
export const isNotFound = (error: unknown) => error instanceof ProblemError && error.status === 404;

/** Whether the service has too much to do now; the same request may succeed soon. */
export const isBusy = (error: unknown) => error instanceof ProblemError && error.status === 429;

/** Whether the service could not be reached or did not answer in time. */
export function isUnreachable(error: unknown): boolean {
  return error instanceof TypeError || (error instanceof DOMException && error.name === "TimeoutError");
}

/** Returns the text of an error for the user. */
export function errorText(error: unknown): string {
  if (isUnreachable(error))
    return "The service does not answer. The page updates when it is available again.";
  const words = error instanceof ProblemError && problemWords(error.problem);
  return words || (error instanceof Error ? error.message : String(error));
}

/** The entity tags of what was fetched: they name the edition that a change replaces. */
const editions = new WeakMap<object, string>();

/** Returns the entity tag of a fetched resource, if its response had one. */
export const editionOf = (fetched: object) => editions.get(fetched);

export async function request<T>(path: string, init: RequestInit = {}): Promise<T> {
  const signal = init.signal ?? AbortSignal.timeout(TIMEOUT_MS);
  const response = await fetch(path, withCredentials({ ...init, signal }));
  if (response.status === 401 && path !== LOGIN) announceUnauthenticated();
  if (!response.ok) throw await failure(response);
  const isJson = response.headers.get("content-type")?.includes("json");
  const value: unknown = isJson ? await response.json() : undefined;
  const etag = response.headers.get("etag");
  if (etag && value && typeof value === "object") editions.set(value, etag);
  return value as T;
}

export const get = <T>(path: string) => request<T>(BASE + path);

/**
 * Sends a change; with `edition`, the service refuses it if another edition is there by now, with
 * null if there is any.
 */
export const send = <T>(method: string, path: string, body?: unknown, edition?: string | null) =>
  request<T>(BASE + path, {
    method,
    ...(body === undefined ? {} : { body: JSON.stringify(body) }),
    headers: {
      ...(body === undefined ? {} : { "content-type": "application/json" }),
      ...(edition ? { "if-match": edition } : {}),
      ...(edition === null ? { "if-none-match": "*" } : {}),
    },
  });

type QueryValues = Record<string, string | number | boolean | null | undefined>;

/** Returns `values` as the query of a URL, without missing and empty values. */
export function query(values: QueryValues): string {
  const given = Object.entries(values).filter(([, value]) => value != null && value !== "");
  return given.length ? `?${new URLSearchParams(given.map(([key, value]) => [key, String(value)]))}` : "";
}

/** Encodes a name or id as one segment of a path. */
export const segment = encodeURIComponent;

/** Fetches all pages of a list, up to at least `limit` items. */
export async function getAll<T>(path: string, values: QueryValues, limit = 20_000): Promise<T[]> {
  const items: T[] = [];
  let cursor: string | null | undefined;
  do {
    const page: Page<T> = await get(path + query({ ...values, limit: 500, cursor }));
    items.push(...page.items);
    cursor = page.next;
  } while (cursor && items.length < limit);
  return items;
}
