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

/** Selects, orders and pages the list of sessions. */
export type SessionQuery = Omit<NonNullable<operations["list_sessions"]["parameters"]["query"]>, "cursor"> & {
  cursor?: string | null;
};

export type TagUse = Schemas["TagUse"];
export type Asset = Schemas["Asset"];
export type AssetAxes = Schemas["Axes"];
export type AxisCalibration = Schemas["AxisCalibration"];
export type MonitorCertificate = Schemas["MonitorCertificate"];
export type Prospects = Schemas["Prospects"];
export type ServoProspects = Schemas["ServoProspects"];
export type Candidate = Schemas["Candidate"];
export type Calibration = Schemas["Calibration"];
export type SessionCalibration = Schemas["SessionCalibration"];
export type Job = Schemas["Job"];
export type CalibrationJob = Schemas["CalibrationJob"];
export type TrainingData = Schemas["TrainingData"];
export type Caller = Schemas["Caller"];
export type DriveCycle = Schemas["DriveCycle"];
export type Evidence = Schemas["Evidence"];
export type FaultEntry = Schemas["FaultEntry"];
export type FaultLine = Schemas["Fault"] & { asset?: string; session_id?: string };
export type CommunicationLine = Schemas["CommunicationEvent"];
export type FleetEntry = Schemas["FleetEntry"];
export type LinkStretch = Schemas["LinkStretch"];
export type RigLink = Schemas["Link"];
export type UnjudgedReason = Schemas["UnjudgedReason"];
export type ServiceHealth = Schemas["Health"];
export type HistoryEntry = Schemas["History"];
export type FileColumn = Schemas["InspectedColumn"];
export type FileInspection = Schemas["Inspection"];
export type FileMotion = Schemas["InspectedMotion"];
/** How a file is to be read: the mapping of its columns, and the rows a second of one without a time. */
export interface FileReading {
  columns?: string;
  rate?: number;
}

export type FileQuantity = Schemas["InspectedQuantity"];
export type ImportResult = Schemas["Import"];
export type Learning = Schemas["Learning"];
export type NewToken = Schemas["MadeToken"];
export type JudgedMonitor = Schemas["Judged"];
export type Monitor = Schemas["Monitor"];
export type Problem = Schemas["Problem"];
export type Remark = Schemas["Remark"];
export type NewRemark = Schemas["NewRemark"];
export type Replay = Schemas["Replay"];
export type ReplaySettings = Schemas["ReplaySettings"];
export type Session = Schemas["Session"];
export type Summary = Schemas["Summary"];
export type State = Schemas["State"];
export type Thresholds = Schemas["Thresholds"];
export type Trace = Schemas["Trace"];
export type Trial = Schemas["Trial"];
export type TriedMonitor = Schemas["TriedMonitor"];
export type Trend = Schemas["Trend"];
export type TrendPoint = Schemas["TrendPoint"];
export type Trends = Schemas["Trends"];
export type FaultRecording = Schemas["Recording"];

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

/** The gains of the controller of the demo's rig. */
export interface DemoGains {
  /** rad/m */
  kp: number;
  /** rad/(m·s) */
  ki: number;
  /** rad·s/m */
  kd: number;
}

/** How the controller of the demo's rig is tuned. */
export interface DemoTuning {
  gains: DemoGains;
  /** The gains with which the demo began. */
  initial: DemoGains;
}
