/** The field's words for codes, kinds, statuses and bits, and how numbers are written. */
import type { Summary } from "./api/types";

export const CODES = ["x_servo", "y_servo", "stuck_ball", "sensor"] as const;

const CODE: Record<string, { title: string; what: string }> = {
  x_servo: { title: "X servo", what: "moves the ball along x: turns the plate about y (qy)" },
  y_servo: { title: "Y servo", what: "moves the ball along y: turns the plate about x (qx)" },
  stuck_ball: { title: "Stuck ball", what: "the ball does not roll where the plate asks it to" },
  sensor: { title: "Position sensor", what: "measures where the ball is" },
};

const KIND: Record<string, string> = {
  dead: "no power: the plate has gone back to zero",
  held: "stays where it is",
  hold: "stays where it is",
  gain: "moves too little or too much",
  reversed: "moves the wrong way round",
  offset: "off by a constant angle, as with a slipped horn",
  slow: "follows far too slowly",
  intermittent: "comes and goes, as with a loose contact",
  frozen: "repeats its last reading",
  freeze: "repeats its last reading",
  dropout: "gives no readings",
  noise: "is far noisier than learnt",
  spikes: "gives lone readings far off",
  jump: "is off by a constant shift",
  glued: "fixed to the plate",
  sticky: "moves only on a large tilt",
};

export const codeTitle = (code: string) => CODE[code]?.title ?? code.replaceAll("_", " ");
export const codeMeaning = (code: string) => CODE[code]?.what ?? "";
export const kindMeaning = (kind?: string | null) =>
  kind ? (KIND[kind] ?? kind.replaceAll("_", " ")) : "the evidence does not say in which way";
export const faultTitle = (code: string, kind?: string | null) => codeTitle(code) + (kind ? `, ${kind}` : "");

/** How much of a session was judged: its share, and how long. */
export const judged = (m: { judged_share?: number; judged_s?: number }) =>
  `${Math.round((m.judged_share ?? 0) * 100)} %, ${duration(m.judged_s ?? 0)}`;

/** Whether the test of a fault line fails: one that passes again says how a fault stands. */
export const isFailing = (line: { status_byte: string }) => (parseInt(line.status_byte, 16) & 1) === 1;

type Cause = { code: string; kind?: string | null; weight: number };

/** Causes in different parts of the rig that read alike, the heaviest first; nothing where there is one. */
export function alike(candidates: Cause[]): string {
  if (!candidates.some((c) => c.code !== candidates[0]!.code)) return "";
  const [first, ...others] = candidates.map(
    (c) => `${faultTitle(c.code, c.kind)} (${Math.round(c.weight * 100)} %)`,
  );
  return `Cannot tell: ${first} or ${others.join(" or ")}`;
}

/** What a session came to, what of it was not judged, and how that is to look. */
export function verdict(of: Summary): { text: string; look: string } {
  const monitors = of.monitors ?? [];
  const titles = (outcome: string) =>
    monitors
      .filter((m) => m.outcome === outcome)
      .map((m) => codeTitle(m.code))
      .join(", ");
  const [pending, sound, unlearnt, unjudged] = ["pending", "no fault", "not learnt", "not judged"].map(
    titles,
  );
  const rest = [unlearnt && `not learnt: ${unlearnt}`, unjudged && `not judged: ${unjudged}`].filter(Boolean);
  const found = of.faults.map(
    (code) =>
      alike(monitors.find((m) => m.code === code && m.outcome === "cannot tell")?.candidates ?? []) ||
      codeTitle(code),
  );
  if (of.outcome === "not judged") return { text: "Not judged", look: "quiet" };
  const first =
    found.join(", ") ||
    (pending
      ? `Pending only: ${pending}`
      : sound && rest.length
        ? `No fault of ${sound}`
        : rest.length
          ? ""
          : "No fault");
  const text = [first, ...rest].filter(Boolean).join("; ");
  return {
    text: text.charAt(0).toUpperCase() + text.slice(1),
    look: found.length
      ? "status-confirmed"
      : pending
        ? "status-pending"
        : rest.length
          ? "quiet"
          : "status-ok",
  };
}

/** Bits of the ISO 14229-1 status byte (annex D.2), from bit 7 down to bit 0. */
export const STATUS_BITS = [
  {
    bit: 7,
    name: "warningIndicatorRequested",
    on: "A warning lamp is asked for.",
    off: "No warning lamp is asked for.",
  },
  {
    bit: 6,
    name: "testNotCompletedThisOperationCycle",
    on: "The test has not come to a result in this session.",
    off: "The test has come to a result in this session.",
  },
  {
    bit: 5,
    name: "testFailedSinceLastClear",
    on: "The test has failed since the code was last cleared.",
    off: "The test has not failed since the code was last cleared.",
  },
  {
    bit: 4,
    name: "testNotCompletedSinceLastClear",
    on: "The test has not come to a result since the last clear.",
    off: "The test has come to a result since the last clear.",
  },
  {
    bit: 3,
    name: "confirmedDTC",
    on: "Confirmed: it failed often enough to be stored as a fault.",
    off: "Not confirmed.",
  },
  {
    bit: 2,
    name: "pendingDTC",
    on: "Pending: it failed in this session or the one before.",
    off: "Not pending.",
  },
  {
    bit: 1,
    name: "testFailedThisOperationCycle",
    on: "The test has failed in this session.",
    off: "The test has not failed in this session.",
  },
  { bit: 0, name: "testFailed", on: "The test fails right now.", off: "The test does not fail right now." },
] as const;

/** How bad: the higher, the worse. */
export function severity(fault: { status: string; acknowledged?: boolean }): number {
  if (fault.status === "confirmed") return fault.acknowledged ? 2 : 3;
  return fault.status === "pending" ? 1 : 0;
}

const NONE = "–";

/** A number with `digits` after the point and its unit; a dash where there is none. */
export function number(value: number | null | undefined, digits: number, unit = ""): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NONE;
  const rounded = value.toFixed(digits);
  const text = Number(rounded) === 0 ? rounded.replace("-", "") : rounded.replace("-", "−");
  return unit ? `${text}\u202f${unit}` : text;
}

export const degrees = (rad: number | null | undefined, digits = 1) =>
  rad === null || rad === undefined ? NONE : `${number((rad * 180) / Math.PI, digits)}°`;
export const millimetres = (m: number | null | undefined, digits = 1) =>
  number(m === null || m === undefined ? m : m * 1e3, digits, "mm");
export const seconds = (s: number | null | undefined, digits = 2) => number(s, digits, "s");
export const count = (n: number) => n.toLocaleString("en").replaceAll(",", "\u202f");

const MINUTE_S = 60;
const HOUR_S = 3600;
const DAY_S = 86_400;

/**
 * A length of time in two parts at most: 3 min 20 s. It is rounded to the smaller part before
 * it is split, so that what comes to a whole of the larger part is carried into it.
 */
export function duration(s: number | null | undefined): string {
  if (s === null || s === undefined) return NONE;
  const tenths = s.toFixed(1);
  if (Number(tenths) < 10) return `${tenths}\u202fs`;
  const inSeconds = Math.round(s);
  if (inSeconds < MINUTE_S) return `${inSeconds}\u202fs`;
  if (inSeconds < HOUR_S) return `${Math.floor(inSeconds / 60)}\u202fmin ${inSeconds % 60}\u202fs`;
  const inMinutes = Math.round(s / MINUTE_S);
  if (inMinutes * MINUTE_S < DAY_S) return `${Math.floor(inMinutes / 60)}\u202fh ${inMinutes % 60}\u202fmin`;
  const inHours = Math.round(s / HOUR_S);
  return `${Math.floor(inHours / 24)}\u202fd ${inHours % 24}\u202fh`;
}

/** How long ago, as a person says it. */
export function ago(moment: string | null | undefined, now = Date.now()): string {
  if (!moment) return "never";
  const s = Math.max(0, (now - Date.parse(moment)) / 1000);
  return s < 2 ? "now" : `${duration(s < 60 ? Math.round(s) : s).replace(".0", "")} ago`;
}

/** What a fault line says, without the code that stands before it, as a sentence. */
export function sentence(summary: string): string {
  const text = summary.replace(/^[^:]*: /, "").replace(/-(?=\d)/g, "−");
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
}

export const clock = (moment: string | null | undefined) =>
  moment ? new Date(moment).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "medium" }) : NONE;
