/** The addresses of the views. */
import type { FaultCode } from "../api/types";

/** Joins `segments` to a path and encodes each. */
export const path = (...segments: string[]) => `/${segments.map(encodeURIComponent).join("/")}`;

export type SetUpStep = "describe" | "connect" | "check" | "learn";

export const rigPath = (name: string) => path("rigs", name);
export const faultPath = (name: string, code: FaultCode) => path("rigs", name, "faults", code);

export const setUpPath = (name: string, step?: SetUpStep) =>
  path("rigs", name, "set-up") + (step ? `?step=${step}` : "");

/** The address of all sessions, or of those of one rig. */
export const sessionsPath = (asset?: string) =>
  asset ? `/sessions?asset=${encodeURIComponent(asset)}` : "/sessions";

/** The address of a session, at the time `t_s` of the device's clock if given. */
export const sessionPath = (id: string, t_s?: number | null) =>
  path("sessions", id) + (t_s == null ? "" : `?t=${t_s.toFixed(2)}`);

/** The address of the comparison of two sessions, the second `shift` seconds later than the first. */
export const comparePath = (a: string, b: string, shift = 0) =>
  `/compare?a=${encodeURIComponent(a)}&b=${encodeURIComponent(b)}${shift ? `&shift=${shift}` : ""}`;
