/** The verdict of a session as text. */
import type { Candidate, FaultCode, FaultLine, JudgedMonitor, Outcome, Summary } from "../api/types";
import { codeMeaning, codeTitle, faultTitle, kindMeaning, kindText } from "./fault-names";
import { seconds } from "./numbers";
import { capitalised } from "./sentence";
import { duration } from "./time";

/** Returns the judged share of a session and its duration. */
export const judgedShare = (monitor: { judged_share?: number; judged_s?: number }) =>
  `${Math.round((monitor.judged_share ?? 0) * 100)} %, ${duration(monitor.judged_s ?? 0)}`;

/** A possible cause of a fault. */
interface Cause {
  title: string;
  meaning: string;
  weight: number;
}

const sum = (weights: number[]) => weights.reduce((all, weight) => all + weight, 0);

/** Returns the causes that the candidates are. Two servos beside another cause are one: both without power. */
export function causesOf(candidates: Candidate[]): Cause[] {
  const servos = candidates.filter(({ code }) => code.endsWith("_servo"));
  const areTwo = servos.length < candidates.length && servos.some(({ code }) => code !== servos[0]!.code);
  const alone = areTwo ? candidates.filter((each) => !servos.includes(each)) : candidates;
  const causes = alone.map(({ code, kind, weight }) => ({
    title: faultTitle({ code, kind }),
    meaning: kind ? kindMeaning(kind) : codeMeaning(code),
    weight,
  }));
  if (!areTwo) return causes;
  const both = {
    title: "Both servos",
    meaning: "do not respond, as without power",
    weight: sum(servos.map(({ weight }) => weight)),
  };
  return [...causes, both];
}

/**
 * Returns the causes with their weights if they are in different parts of the rig, so that the
 * evidence does not distinguish them; otherwise an empty string.
 */
export function ambiguousCauses(candidates: Candidate[]): string {
  if (!candidates.some(({ code }) => code !== candidates[0]!.code)) return "";
  const [first, ...others] = causesOf(candidates).map(
    ({ title, weight }) => `${title} ${Math.round(weight * 100)} %`,
  );
  return `Cannot tell: ${first} or ${others.join(" or ")}`;
}

type Finding = Pick<FaultLine, "code" | "kind" | "status" | "t_s"> & Partial<Pick<FaultLine, "candidates">>;

const RESULTS: Partial<Record<Outcome, string>> = { pending: "suspected", "not learnt": "not calibrated" };

/** The word for the result of a monitor. */
export const resultText = (outcome: Outcome) => RESULTS[outcome] ?? outcome;

/** Whether `profile` has a test for a code: that of the book tests the servos only. */
const hasTest = (code: string, profile?: string | null) => profile !== "textbook" || code.endsWith("_servo");

/** Returns each kind of a confirmed code as text, with the time at which it was first named. */
function kindsOf(code: FaultCode, monitor: JudgedMonitor | undefined, lines: Finding[]): [string, number][] {
  if (monitor?.kinds?.length)
    return monitor.kinds.map(({ kind, t_s, weight }) => [kindText({ code, kind, kind_weight: weight }), t_s]);
  // An earlier version has stored the summary without them.
  const named = lines.filter((line) => line.code === code && line.status === "confirmed" && line.kind);
  const firsts = named.filter(({ kind }, i) => named.findIndex((line) => line.kind === kind) === i);
  return firsts.map((line) => [kindText(line), line.t_s]);
}

/**
 * Returns the title of a fault with the kind that was confirmed first and those named later, or its candidates if its
 * monitor could not distinguish them.
 */
function faultText(summary: Summary, code: FaultCode, lines: Finding[]): string {
  const monitor = summary.monitors?.find((each) => each.code === code);
  const causes = monitor?.outcome === "cannot tell" ? ambiguousCauses(monitor.candidates) : "";
  if (causes) return causes;
  const [first, ...later] = kindsOf(code, monitor, lines);
  if (!first) return codeTitle(code);
  const others = later.map(([kind, t_s]) => `, later ${kind} at ${seconds(t_s)}`);
  return `${codeTitle(code)} (${first[0]}${others.join("")})`;
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

/** Whether a wrong unit explains the faults as well, as a warning of the summary says. */
const isExcused = ({ outcome, monitors, faults }: Summary) =>
  outcome === "cannot tell" &&
  !monitors?.some((each) => faults.includes(each.code) && each.outcome === outcome);

/**
 * Returns the result of a session, with the monitors that did not judge it, and its style. The kinds of its faults are
 * in the summary, or else in the lines of their changes. `profile` is the one that it was judged by, if that is known.
 */
export function verdict(summary: Summary, lines: Finding[] = [], profile?: string | null): Verdict {
  if (summary.outcome === "not judged") return { text: "Not judged", look: "quiet" };
  const all = summary.monitors ?? [];
  const tested = all.filter(({ code }) => hasTest(code, profile));
  const others = all.filter(({ code }) => !hasTest(code, profile));
  const faults = summary.faults.map((code) => faultText(summary, code, lines)).join(", ");
  const found = faults && isExcused(summary) ? `Cannot tell a wrong unit from ${faults}` : faults;
  const suspected = listed(all, "pending", "Suspected only");
  const passed = listed(all, "no fault", "No fault");
  const unfound = all.filter(({ code }) => !summary.faults.includes(code));
  const doubted = listed(unfound, "cannot tell", "cannot tell");
  const rest = [
    doubted,
    listed(all, "not learnt", "not calibrated"),
    listed(tested, "not judged", "not judged"),
    listed(others, "not judged", "no test in this profile"),
  ].filter(Boolean);
  const text = (first: string) => capitalised([first, ...rest].filter(Boolean).join("; "));
  if (found) return { text: text(found), look: "status-confirmed" };
  if (suspected || doubted) return { text: text(suspected || passed), look: "status-pending" };
  if (rest.length) return { text: text(passed), look: "quiet" };
  return { text: "No fault", look: "status-ok" };
}
