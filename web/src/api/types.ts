/** The types of the API under short names. `npm run types` generates them from openapi.yaml. */
import type { components, operations } from "../../generated/schema";

type Schemas = components["schemas"];

// Closed vocabularies.
export type Axis = Schemas["Axis"];
export type DriveCycleOrder = Schemas["DriveCycleOrder"];
export type FaultCode = Schemas["FaultCode"];
export type FaultKind = Schemas["FaultKind"];
export type FaultStatus = Schemas["FaultStatus"];
export type HistoryEvent = Schemas["HistoryEvent"];
export type JobState = Schemas["JobState"];
export type LearningState = Schemas["LearningState"];
export type Outcome = Schemas["Outcome"];
export type PlateAngle = Schemas["PlateAngle"];
export type Profile = Schemas["Profile"];
export type ServoParameter = Schemas["ServoParameter"];
export type SessionState = Schemas["SessionState"];

/** Selects faults of a list by status. */
export type FaultFilter = NonNullable<
  NonNullable<operations["list_asset_faults"]["parameters"]["query"]>["status"]
>;

export type Asset = Schemas["AssetView"];
export type AssetAxes = Schemas["AxesView"];
export type AxisCalibration = Schemas["AxisCalibrationView"];
export type MonitorCertificate = Schemas["MonitorCertificateView"];
export type Prospects = Schemas["ProspectsView"];
export type ServoProspects = Schemas["ServoProspectsView"];
export type Candidate = Schemas["CandidateView"];
export type Calibration = Schemas["CalibrationView"];
export type CalibrationJob = Schemas["CalibrationJobView"];
export type Caller = Schemas["CallerView"];
export type DriveCycle = Schemas["DriveCycleView"];
export type Evidence = Schemas["EvidenceView"];
export type FaultEntry = Schemas["FaultEntryView"];
export type FaultLine = Schemas["FaultView"] & { asset?: string; session_id?: string };
export type FleetEntry = Schemas["FleetEntryView"];
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

/** The state of the demo's rig; only the demo serves it. */
export interface Demo {
  asset: string;
  /** Whether the script injects and repairs faults. */
  script: boolean;
  /** The injected faults, as `x_servo:dead`. */
  broken: string[];
  /** The faults that can be injected. */
  buttons: string[];
}
