/** The requests of the page to the service. */
import { actor, withCredentials } from "./access";
import { FORMATS, type FormatName } from "./formats";
import { BASE, editionOf, failure, get, getAll, LOGIN, query, request, segment, send } from "./request";
import type {
  Asset,
  CalibrationJob,
  Caller,
  Demo,
  DemoGains,
  DemoTuning,
  DriveCycle,
  FaultCode,
  FaultEntry,
  FaultFilter,
  FaultLine,
  FaultRecording,
  FileInspection,
  FileReading,
  FleetEntry,
  HistoryEntry,
  ImportResult,
  Learning,
  NewRemark,
  NewToken,
  Page,
  Profile,
  Remark,
  Replay,
  ReplaySettings,
  RigLink,
  ServiceHealth,
  Session,
  SessionCalibration,
  SessionQuery,
  State,
  Trace,
  Trends,
  Trial,
} from "./types";

/** The path of a fault of a rig. */
const faultPath = (name: string, code: FaultCode) => `/assets/${segment(name)}/faults/${segment(code)}`;

/** Sends a recording to be imported; its first bytes tell the format. */
const sendFile = <T>(
  asset: string,
  file: File,
  values: Record<string, string | number | boolean | undefined>,
  signal = AbortSignal.timeout(900_000),
) =>
  request<T>(`${BASE}/assets/${segment(asset)}/sessions/import${query(values)}`, {
    method: "POST",
    body: file,
    headers: { "content-type": "application/octet-stream" },
    signal,
  });

export const api = {
  health: () => request<ServiceHealth>("/healthz"),
  caller: () => request<Caller>(LOGIN),
  logIn: (token: string) => send<Caller>("POST", "/login", { token }),
  logOut: () => send<void>("DELETE", "/login"),
  createDeviceToken: (asset: string) =>
    send<NewToken>("POST", "/tokens", {
      name: `${asset.slice(0, 70)} ${new Date().toISOString()}`,
      role: "device",
      asset,
    }),
  fleet: () => getAll<FleetEntry>("/fleet", {}),
  asset: (name: string) => get<Asset>(`/assets/${segment(name)}`),
  createAsset: (asset: Partial<Asset>) => send<Asset>("POST", "/assets", asset),
  putAsset: (asset: Asset, before: Asset) =>
    send<Asset>("PUT", `/assets/${segment(asset.name)}`, asset, editionOf(before)),
  deleteAsset: (name: string) => send<void>("DELETE", `/assets/${segment(name)}`),
  state: (name: string) => get<State>(`/assets/${segment(name)}/state`),
  link: (name: string) => get<RigLink>(`/assets/${segment(name)}/link`),
  driveCycle: (name: string) => get<DriveCycle>(`/assets/${segment(name)}/drive-cycle`),
  trends: (name: string) => get<Trends>(`/assets/${segment(name)}/trends`),
  faultsOf: (name: string, status: FaultFilter = "all") =>
    get<Page<FaultEntry>>(`/assets/${segment(name)}/faults${query({ status })}`).then((page) => page.items),
  fault: (name: string, code: FaultCode) => get<FaultEntry>(faultPath(name, code)),
  /** The recorded and judged seconds around the last occurrence. */
  faultRecording: (name: string, code: FaultCode, range: { before_s: number; after_s: number }) =>
    get<FaultRecording>(`${faultPath(name, code)}/recording${query(range)}`),
  history: (name: string, code: FaultCode) =>
    get<Page<HistoryEntry>>(`${faultPath(name, code)}/history${query({ limit: 200 })}`),
  acknowledge: (name: string, code: FaultCode) =>
    send<FaultEntry>("POST", `${faultPath(name, code)}/acknowledge${query({ by: actor() })}`),
  clear: (name: string, code: FaultCode) =>
    send<void>("DELETE", `${faultPath(name, code)}${query({ by: actor() })}`),
  sessions: (values: SessionQuery) => get<Page<Session>>(`/sessions${query(values)}`),
  session: (session: string) => get<Session>(`/sessions/${segment(session)}`),
  /** The calibration that a session is judged with. */
  sessionCalibration: (session: string) =>
    get<SessionCalibration>(`/sessions/${segment(session)}/calibration`),
  sessionFaults: (session: string) => getAll<FaultLine>(`/sessions/${segment(session)}/faults`, {}, 2000),
  endSession: (session: string) => send<Session>("POST", `/sessions/${segment(session)}/end`),
  deleteSession: (session: string) => send<void>("DELETE", `/sessions/${segment(session)}`),
  trace: (
    session: string,
    range: { from_s?: number; to_s?: number; points?: number; profile?: Profile; calibration?: string } = {},
  ) => get<Trace>(`/sessions/${segment(session)}/trace${query(range)}`),
  trial: (session: string, settings: Record<string, number | string | undefined>) =>
    get<Trial>(`/sessions/${segment(session)}/trial${query(settings)}`),
  remarks: (session: string) =>
    get<Page<Remark>>(`/sessions/${segment(session)}/remarks`).then((page) => page.items),
  addRemark: (session: string, remark: NewRemark) =>
    send<Remark>("POST", `/sessions/${segment(session)}/remarks${query({ by: actor() })}`, remark),
  removeRemark: (session: string, id: string) =>
    send<void>("DELETE", `/sessions/${segment(session)}/remarks/${segment(id)}`),
  /** Reads a file without importing it. */
  inspectRecording: (asset: string, file: File, reading: FileReading, signal: AbortSignal) =>
    sendFile<FileInspection>(asset, file, { ...reading, dry_run: true }, signal),
  importRecording: (asset: string, name: string, file: File, reading: FileReading) =>
    sendFile<ImportResult>(asset, file, { ...reading, name }),
  replay: (session: string, settings: ReplaySettings) =>
    send<Replay>("POST", `/sessions/${segment(session)}/replays`, settings),
  replayState: (replay: string) => get<Replay>(`/replays/${segment(replay)}`),
  calibrate: (asset: string, sessions: string[]) =>
    send<CalibrationJob>("POST", `/assets/${segment(asset)}/calibrations${query({ by: actor() })}`, {
      sessions,
    }),
  calibrations: (asset: string) => getAll<CalibrationJob>(`/assets/${segment(asset)}/calibrations`, {}),
  calibration: (asset: string, job: string) =>
    get<CalibrationJob>(`/assets/${segment(asset)}/calibrations/${segment(job)}`),
  learning: (asset: string) => get<Learning>(`/assets/${segment(asset)}/learning`),
  acceptLearning: (asset: string) =>
    send<Learning>("POST", `/assets/${segment(asset)}/learning/accept${query({ by: actor() })}`),
  discardLearning: (asset: string) => send<Learning>("POST", `/assets/${segment(asset)}/learning/discard`),
  activate: (asset: string, job: string) =>
    send<CalibrationJob>(
      "POST",
      `/assets/${segment(asset)}/calibrations/${segment(job)}/activate${query({ by: actor() })}`,
    ),
  /** Fetches the recording as a file, with the same credentials as all requests. */
  recording: async (session: string, format: FormatName) => {
    const init = withCredentials({ headers: { accept: FORMATS[format].mediaType } });
    const response = await fetch(`${BASE}/sessions/${segment(session)}/telemetry`, init);
    if (!response.ok) throw await failure(response);
    return response.blob();
  },
  demo: () => get<Demo>("/demo"),
  injectDemoFault: (fault: string) => send<void>("POST", "/demo/faults", { fault }),
  repairDemo: () => send<void>("DELETE", "/demo/faults"),
  resumeDemoScript: () => send<void>("POST", "/demo/script"),
  demoTuning: () => get<DemoTuning>("/demo/gains"),
  tuneDemo: (gains: DemoGains) => send<DemoTuning>("PUT", "/demo/gains", gains),
};
