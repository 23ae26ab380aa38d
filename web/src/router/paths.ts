/** The addresses of the page's views. */

/** A path of `segments`, whatever is in them. */
export const path = (...segments: string[]) => `/${segments.map(encodeURIComponent).join("/")}`;

export type SetUpStep = "describe" | "connect" | "check" | "learn";

export const rigPath = (name: string) => path("rigs", name);
export const faultPath = (name: string, code: string) => path("rigs", name, "faults", code);

export const setUpPath = (name: string, step?: SetUpStep) =>
  path("rigs", name, "set-up") + (step ? `?step=${step}` : "");

/** All sessions, or those of one rig. */
export const sessionsPath = (asset?: string) =>
  asset ? `/sessions?asset=${encodeURIComponent(asset)}` : "/sessions";

/** A session, at the moment `t_s` of the device's clock if given. */
export const sessionPath = (id: string, t_s?: number | null) =>
  path("sessions", id) + (t_s == null ? "" : `?t=${t_s.toFixed(2)}`);
