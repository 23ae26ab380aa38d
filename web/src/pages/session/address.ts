/** The moment, speed and profile of a playback in the query of its address. */
import type { ProfileOrRecorded } from "./profile-choice";

export interface SessionAddress {
  /** Time on the device's clock, s. */
  t?: number;
  speed: number;
  profile: ProfileOrRecorded;
}

/** Selectable speeds of the playback. */
export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10];

const PROFILES: ProfileOrRecorded[] = ["default", "textbook"];

/** Reads the query of an address; what is not known there is left out. */
export function readAddress(search: string): SessionAddress {
  const query = new URLSearchParams(search);
  const t = Number(query.get("t") || NaN);
  const speed = Number(query.get("speed"));
  const profile = query.get("profile") as ProfileOrRecorded;
  return {
    t: Number.isFinite(t) ? t : undefined,
    speed: SPEEDS.includes(speed) ? speed : 1,
    profile: PROFILES.includes(profile) ? profile : "",
  };
}

/** Returns the query with the changed values; the usual ones are left out. */
export function withAddress(search: string, { t, speed, profile }: Partial<SessionAddress>): string {
  const query = new URLSearchParams(search);
  const set = (key: string, value: string, usual: string) =>
    value === usual ? query.delete(key) : query.set(key, value);
  if (t !== undefined) query.set("t", t.toFixed(2));
  if (speed !== undefined) set("speed", String(speed), "1");
  if (profile !== undefined) set("profile", profile, "");
  return query.size ? `?${query}` : "";
}
