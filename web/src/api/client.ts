/** Requests to the interface. What goes wrong is a `ProblemError` with the service's own words. */
import { actor, authorised, shut } from "./access";
import type {
  Around,
  Asset,
  CalibrationJob,
  Caller,
  Demo,
  DriveCycle,
  FaultEntry,
  FaultLine,
  FleetEntry,
  Health,
  History,
  Import,
  Learning,
  MadeToken,
  Page,
  Problem,
  Replay,
  ReplaySettings,
  Session,
  State,
  Trace,
  Trends,
} from "./types";

const BASE = "/api/v1";
const LOGIN = `${BASE}/login`;

/** Longest wait for an answer; an import may take longer. */
const TIMEOUT_MS = 70_000;

export class ProblemError extends Error {
  constructor(
    readonly status: number,
    readonly problem: Partial<Problem>,
  ) {
    super(problem.detail ?? problem.title ?? `the service answered ${status}`);
  }
}

/** True where the service does not know who asks. */
export const isUnauthenticated = (error: unknown) => error instanceof ProblemError && error.status === 401;

/** True where the service could not be reached at all. */
export function isUnreachable(error: unknown): boolean {
  return error instanceof TypeError || (error instanceof DOMException && error.name === "TimeoutError");
}

export function words(error: unknown): string {
  if (isUnreachable(error)) return "The service does not answer. The page goes on as soon as it does.";
  return error instanceof Error ? error.message : String(error);
}

async function ask<T>(path: string, init: RequestInit = {}): Promise<T> {
  const signal = init.signal ?? AbortSignal.timeout(TIMEOUT_MS);
  const answer = await fetch(path, authorised({ ...init, signal }));
  if (answer.status === 401 && path !== LOGIN) shut();
  if (!answer.ok)
    throw new ProblemError(answer.status, (await answer.json().catch(() => ({}))) as Partial<Problem>);
  const isJson = answer.headers.get("content-type")?.includes("json");
  return (isJson ? await answer.json() : undefined) as T;
}

const get = <T>(path: string) => ask<T>(BASE + path);
const send = <T>(method: string, path: string, body?: unknown) =>
  ask<T>(BASE + path, {
    method,
    ...(body === undefined
      ? {}
      : { body: JSON.stringify(body), headers: { "content-type": "application/json" } }),
  });

type Query = Record<string, string | number | boolean | null | undefined>;

function query(values: Query): string {
  const set = Object.entries(values).filter(
    ([, value]) => value !== null && value !== undefined && value !== "",
  );
  return set.length ? `?${new URLSearchParams(set.map(([key, value]) => [key, String(value)]))}` : "";
}

const id = encodeURIComponent;

/** Every page of a list, at most `most` items. */
async function all<T>(path: string, values: Query, most = 20_000): Promise<T[]> {
  const items: T[] = [];
  let cursor: string | null | undefined;
  do {
    const page: Page<T> = await get(path + query({ ...values, limit: 500, cursor }));
    items.push(...page.items);
    cursor = page.next;
  } while (cursor && items.length < most);
  return items;
}

export const api = {
  health: () => ask<Health>("/healthz"),
  caller: () => ask<Caller>(LOGIN),
  logIn: (token: string) => send<Caller>("POST", "/login", { token }),
  logOut: () => send<void>("DELETE", "/login"),
  createDeviceToken: (asset: string) =>
    send<MadeToken>("POST", "/tokens", {
      name: `${asset.slice(0, 70)} ${new Date().toISOString()}`,
      role: "device",
      asset,
    }),
  fleet: () => all<FleetEntry>("/fleet", {}),
  asset: (name: string) => get<Asset>(`/assets/${id(name)}`),
  createAsset: (asset: Partial<Asset>) => send<Asset>("POST", "/assets", asset),
  putAsset: (asset: Asset) => send<Asset>("PUT", `/assets/${id(asset.name)}`, asset),
  deleteAsset: (name: string) => send<void>("DELETE", `/assets/${id(name)}`),
  state: (name: string) => get<State>(`/assets/${id(name)}/state`),
  driveCycle: (name: string) => get<DriveCycle>(`/assets/${id(name)}/drive-cycle`),
  trends: (name: string) => get<Trends>(`/assets/${id(name)}/trends`),
  faultsOf: (name: string, status = "all") =>
    get<Page<FaultEntry>>(`/assets/${id(name)}/faults${query({ status })}`).then((page) => page.items),
  fault: (name: string, code: string) => get<FaultEntry>(`/assets/${id(name)}/faults/${id(code)}`),
  /** The seconds around the last occurrence, as recorded and as judged. */
  around: (name: string, code: string, stretch: { before_s: number; after_s: number }) =>
    get<Around>(`/assets/${id(name)}/faults/${id(code)}/recording${query(stretch)}`),
  history: (name: string, code: string) =>
    get<Page<History>>(`/assets/${id(name)}/faults/${id(code)}/history${query({ limit: 200 })}`),
  acknowledge: (name: string, code: string) =>
    send<FaultEntry>("POST", `/assets/${id(name)}/faults/${id(code)}/acknowledge${query({ by: actor() })}`),
  clear: (name: string, code: string) =>
    send<void>("DELETE", `/assets/${id(name)}/faults/${id(code)}${query({ by: actor() })}`),
  sessions: (values: { asset?: string; state?: string; cursor?: string | null; limit?: number }) =>
    get<Page<Session>>(`/sessions${query(values)}`),
  session: (session: string) => get<Session>(`/sessions/${id(session)}`),
  sessionFaults: (session: string) => all<FaultLine>(`/sessions/${id(session)}/faults`, {}, 2000),
  endSession: (session: string) => send<Session>("POST", `/sessions/${id(session)}/end`),
  deleteSession: (session: string) => send<void>("DELETE", `/sessions/${id(session)}`),
  trace: (
    session: string,
    stretch: { from_s?: number; to_s?: number; points?: number; profile?: string } = {},
  ) => get<Trace>(`/sessions/${id(session)}/trace${query(stretch)}`),
  importCsv: (asset: string, name: string, csv: string) =>
    ask<Import>(`${BASE}/assets/${id(asset)}/sessions/import${query({ name })}`, {
      method: "POST",
      body: csv,
      headers: { "content-type": "text/csv" },
      signal: AbortSignal.timeout(900_000),
    }),
  replay: (session: string, settings: ReplaySettings) =>
    send<Replay>("POST", `/sessions/${id(session)}/replays`, settings),
  replayState: (replay: string) => get<Replay>(`/replays/${id(replay)}`),
  calibrate: (asset: string, sessions: string[]) =>
    send<CalibrationJob>("POST", `/assets/${id(asset)}/calibrations`, { sessions }),
  calibration: (asset: string, job: string) =>
    get<CalibrationJob>(`/assets/${id(asset)}/calibrations/${id(job)}`),
  learning: (asset: string) => get<Learning>(`/assets/${id(asset)}/learning`),
  acceptLearning: (asset: string) => send<Learning>("POST", `/assets/${id(asset)}/learning/accept`),
  discardLearning: (asset: string) => send<Learning>("POST", `/assets/${id(asset)}/learning/discard`),
  activate: (asset: string, job: string) =>
    send<CalibrationJob>("POST", `/assets/${id(asset)}/calibrations/${id(job)}/activate`),
  /** The recording as a file; asked for like all else, so that it needs no other way to be allowed. */
  recording: async (session: string) => {
    const init = authorised({ headers: { accept: "text/csv" } });
    const answer = await fetch(`${BASE}/sessions/${id(session)}/telemetry`, init);
    if (!answer.ok)
      throw new ProblemError(answer.status, (await answer.json().catch(() => ({}))) as Partial<Problem>);
    return answer.blob();
  },
  demo: () => get<Demo>("/demo"),
  demoBreak: (fault: string) => send<void>("POST", "/demo/faults", { fault }),
  demoRepair: () => send<void>("DELETE", "/demo/faults"),
  demoScript: () => send<void>("POST", "/demo/script"),
};

const POLL_MS = 300;

/** Asks again until `done` says so. */
export async function until<T>(
  look: () => Promise<T>,
  done: (seen: T) => boolean,
  show: (seen: T) => void = () => {},
): Promise<T> {
  for (;;) {
    const seen = await look();
    show(seen);
    if (done(seen)) return seen;
    await new Promise((go) => setTimeout(go, POLL_MS));
  }
}

export const isSettled = (job: { state: string }) => job.state === "done" || job.state === "failed";
