/** The addresses of the views. */
import type { FaultCode } from "../api/types";

/** Joins `segments` to a path and encodes each. */
export const path = (...segments: string[]) => `/${segments.map(encodeURIComponent).join("/")}`;

export type SetUpStep = "describe" | "connect" | "check" | "learn";

export const rigPath = (name: string) => path("rigs", name);
export const calibrationsPath = (name: string) => path("rigs", name, "calibrations");
export const faultPath = (name: string, code: FaultCode) => path("rigs", name, "faults", code);

export const setUpPath = (name: string, step?: SetUpStep) =>
  path("rigs", name, "set-up") + (step ? `?step=${step}` : "");

/** `path` with those of the values that are not empty as its query. */
function withQuery(path: string, values: Record<string, string | undefined>): string {
  const given = Object.entries(values).filter(([, value]) => value);
  const parts = given.map(([key, value]) => `${key}=${encodeURIComponent(value!)}`);
  return parts.length ? `${path}?${parts.join("&")}` : path;
}

/** The address of the fleet, or of its rigs with a tag. */
export const fleetPath = (values: { tag?: string } = {}) => withQuery("/", values);

/** The address of the lessons, which have the controls of the demo. */
export const lessonsPath = () => path("learn");

/** The address of the background jobs. */
export const jobsPath = () => path("jobs");

/** The addresses of the reports to print. */
export const sessionReportPath = (id: string) => path("sessions", id, "report");
export const faultReportPath = (name: string, code: FaultCode) =>
  path("rigs", name, "faults", code, "report");

/** The address of all sessions, or of those of one rig or of the rigs with a tag. */
export const sessionsPath = (asset?: string, tag?: string) => withQuery("/sessions", { asset, tag });

/** The address of a session, at the time `t_s` of the device's clock if given. */
export const sessionPath = (id: string, t_s?: number | null) =>
  path("sessions", id) + (t_s == null ? "" : `?t=${t_s.toFixed(2)}`);

/** The address of the comparison of two sessions, the second `shift` seconds later than the first. */
export const comparePath = (a: string, b: string, shift = 0) =>
  `/compare?a=${encodeURIComponent(a)}&b=${encodeURIComponent(b)}${shift ? `&shift=${shift}` : ""}`;
