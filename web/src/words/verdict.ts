/** The verdict of a session as text. */
import type { Candidate, FaultCode, FaultLine, JudgedMonitor, Outcome, Summary } from "../api/types";
import { codeTitle, faultTitle, kindText } from "./fault-names";
import { capitalised } from "./sentence";
import { duration } from "./time";

/** Returns the judged share of a session and its duration. */
export const judgedShare = (monitor: { judged_share?: number; judged_s?: number }) =>
  `${Math.round((monitor.judged_share ?? 0) * 100)} %, ${duration(monitor.judged_s ?? 0)}`;

/**
 * Returns the candidates with their weights if they are in different parts of the rig, so that the
 * evidence does not distinguish them; otherwise an empty string.
 */
export function ambiguousCauses(candidates: Candidate[]): string {
  if (!candidates.some(({ code }) => code !== candidates[0]!.code)) return "";
  const [first, ...others] = candidates.map(
    ({ code, kind, weight }) => `${faultTitle({ code, kind })} ${Math.round(weight * 100)} %`,
  );
  return `Cannot tell: ${first} or ${others.join(" or ")}`;
}

type Finding = Pick<FaultLine, "code" | "kind" | "status"> & Partial<Pick<FaultLine, "candidates">>;

const RESULTS: Partial<Record<Outcome, string>> = { pending: "suspected", "not learnt": "not calibrated" };

/** The word for the result of a monitor. */
export const resultText = (outcome: Outcome) => RESULTS[outcome] ?? outcome;

/** Whether `profile` has a test for a code: that of the book tests the servos only. */
const hasTest = (code: string, profile?: string | null) => profile !== "textbook" || code.endsWith("_servo");

/**
 * Returns the title of a fault with the kind that was confirmed first and those named later, or its candidates if its
 * monitor could not distinguish them.
 */
function faultText(summary: Summary, code: FaultCode, lines: Finding[]): string {
  const monitor = summary.monitors?.find((each) => each.code === code && each.outcome === "cannot tell");
  const confirmed = lines.filter((line) => line.code === code && line.status === "confirmed");
  const kinds = new Map(confirmed.flatMap((line) => (line.kind ? [[line.kind, kindText(line)]] : [])));
  const named = kinds.size ? ` (${[...kinds.values()].join(", later ")})` : "";
  return ambiguousCauses(monitor?.candidates ?? []) || codeTitle(code) + named;
}

export interface Verdict {
  text: string;
  /** The class of the style sheet for its colour. */
  look: string;
}

/** The titles of the monitors with a result, after `words`; empty without any. */
function listed(monitors: JudgedMonitor[], outcome: Outcome, words: string): string {
  const titles = monitors.filter((each) => each.outcome === outcome).map(({ code }) => codeTitle(code));
  return titles.length ? `${words}: ${titles.join(", ")}` : "";
}

/**
 * Returns the result of a session, with the monitors that did not judge it, and its style. The kinds of its faults are
 * in the lines of their changes. `profile` is the one that it was judged by, if that is known.
 */
export function verdict(summary: Summary, lines: Finding[] = [], profile?: string | null): Verdict {
  if (summary.outcome === "not judged") return { text: "Not judged", look: "quiet" };
  const all = summary.monitors ?? [];
  const tested = all.filter(({ code }) => hasTest(code, profile));
  const others = all.filter(({ code }) => !hasTest(code, profile));
  const found = summary.faults.map((code) => faultText(summary, code, lines)).join(", ");
  const suspected = listed(all, "pending", "Suspected only");
  const passed = listed(all, "no fault", "No fault");
  const rest = [
    listed(all, "not learnt", "not calibrated"),
    listed(tested, "not judged", "not judged"),
    listed(others, "not judged", "no test in this profile"),
  ].filter(Boolean);
  const text = (first: string) => capitalised([first, ...rest].filter(Boolean).join("; "));
  if (found) return { text: text(found), look: "status-confirmed" };
  if (suspected) return { text: text(suspected), look: "status-pending" };
  if (rest.length) return { text: text(passed), look: "quiet" };
  return { text: "No fault", look: "status-ok" };
}
