/** The interface's own types, under short names. `npm run types` makes them from openapi.yaml. */
import type { components } from "../../generated/schema";

type Schemas = components["schemas"];

export type Asset = Schemas["AssetView"];
export type AssetAxes = Schemas["AxesView"];
export type Axis = "x" | "y";
export type AxisCalibration = Schemas["AxisCalibrationView"];
export type MonitorCertificate = Schemas["MonitorCertificateView"];
export type Prospects = Schemas["ProspectsView"];
export type ServoProspects = Schemas["ServoProspectsView"];
export type AxisTrace = Schemas["AxisTraceView"];
export type Calibration = Schemas["CalibrationView"];
export type CalibrationJob = Schemas["CalibrationJobView"];
export type Caller = Schemas["CallerView"];
export type DriveCycle = Schemas["DriveCycleView"];
export type Evidence = Schemas["EvidenceView"];
export type FaultEntry = Schemas["FaultEntryView"];
export type FaultLine = Schemas["FaultView"] & { asset?: string; session_id?: string };
export type FleetEntry = Schemas["FleetEntryView"];
export type FleetFault = Schemas["FleetFaultView"];
export type ServiceHealth = Schemas["HealthView"];
export type HistoryEntry = Schemas["HistoryView"];
export type ImportResult = Schemas["ImportView"];
export type Learning = Schemas["LearningView"];
export type NewToken = Schemas["MadeTokenView"];
export type JudgedMonitor = Schemas["JudgedView"];
export type Monitor = Schemas["MonitorView"];
export type Problem = Schemas["Problem"];
export type Replay = Schemas["ReplayView"];
export type ReplaySettings = Schemas["ReplaySettingsView"];
export type Session = Schemas["SessionView"];
export type Summary = Schemas["SummaryView"];
export type State = Schemas["StateView"];
export type Trace = Schemas["TraceView"];
export type Trend = Schemas["TrendView"];
export type TrendPoint = Schemas["TrendPointView"];
export type Trends = Schemas["TrendsView"];
export type FaultRecording = Schemas["RecordingView"];

export interface Page<T> {
  items: T[];
  next?: string | null;
}

/** What the demo says of its rig; only the demo answers this. */
export interface Demo {
  asset: string;
  script: boolean;
  broken: string[];
  buttons: string[];
}
