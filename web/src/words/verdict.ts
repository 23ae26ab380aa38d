/** The verdict of a session as text. */
import type { Candidate, FaultCode, FaultLine, Outcome, Summary } from "../api/types";
import { codeTitle, faultTitle } from "./fault-names";
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
    ({ code, kind, weight }) => `${faultTitle(code, kind)} (${Math.round(weight * 100)} %)`,
  );
  return `Cannot tell: ${first} or ${others.join(" or ")}`;
}

type Finding = Pick<FaultLine, "code" | "kind" | "status">;

/**
 * Returns the title of a fault with the kind that was confirmed first and those named later, or its candidates if its
 * monitor could not distinguish them.
 */
function faultText(summary: Summary, code: FaultCode, lines: Finding[]): string {
  const monitor = summary.monitors?.find((each) => each.code === code && each.outcome === "cannot tell");
  const confirmed = lines.filter((line) => line.code === code && line.status === "confirmed");
  const kinds = new Set(confirmed.flatMap(({ kind }) => (kind ? [kind] : [])));
  const named = kinds.size ? ` (${[...kinds].join(", later ")})` : "";
  return ambiguousCauses(monitor?.candidates ?? []) || codeTitle(code) + named;
}

export interface Verdict {
  text: string;
  /** The class of the style sheet for its colour. */
  look: string;
}

/**
 * Returns the result of a session, with the monitors that did not judge it, and its style. The kinds of its faults are
 * in the lines of their changes.
 */
export function verdict(summary: Summary, lines: Finding[] = []): Verdict {
  if (summary.outcome === "not judged") return { text: "Not judged", look: "quiet" };
  const titles = (outcome: Outcome) => {
    const monitors = (summary.monitors ?? []).filter((monitor) => monitor.outcome === outcome);
    return monitors.map((monitor) => codeTitle(monitor.code)).join(", ");
  };
  const found = summary.faults.map((code) => faultText(summary, code, lines)).join(", ");
  const pending = titles("pending");
  const passed = titles("no fault");
  const notLearnt = titles("not learnt");
  const notJudged = titles("not judged");
  const rest = [notLearnt && `not learnt: ${notLearnt}`, notJudged && `not judged: ${notJudged}`].filter(
    Boolean,
  );
  const text = (first: string) => capitalised([first, ...rest].filter(Boolean).join("; "));
  if (found) return { text: text(found), look: "status-confirmed" };
  if (pending) return { text: text(`Pending only: ${pending}`), look: "status-pending" };
  if (rest.length) return { text: text(passed && `No fault of ${passed}`), look: "quiet" };
  return { text: "No fault", look: "status-ok" };
}
