/** What a session came to, in words. */
import type { Summary } from "../api/types";
import { codeTitle, faultTitle } from "./fault-names";
import { capitalised } from "./sentence";
import { duration } from "./time";

/** How much of a session was judged: its share, and how long. */
export const judgedShare = (monitor: { judged_share?: number; judged_s?: number }) =>
  `${Math.round((monitor.judged_share ?? 0) * 100)} %, ${duration(monitor.judged_s ?? 0)}`;

type Cause = { code: string; kind?: string | null; weight: number };

/** Causes in different parts of the rig that the evidence cannot tell apart, the heaviest first; else nothing. */
export function ambiguousCauses(candidates: Cause[]): string {
  if (!candidates.some((cause) => cause.code !== candidates[0]!.code)) return "";
  const [first, ...others] = candidates.map(
    ({ code, kind, weight }) => `${faultTitle(code, kind)} (${Math.round(weight * 100)} %)`,
  );
  return `Cannot tell: ${first} or ${others.join(" or ")}`;
}

/** A fault of the summary, or the causes among which its monitor could not tell. */
function faultFound(summary: Summary, code: string): string {
  const monitor = summary.monitors?.find((each) => each.code === code && each.outcome === "cannot tell");
  return ambiguousCauses(monitor?.candidates ?? []) || codeTitle(code);
}

export interface Verdict {
  text: string;
  /** The class of the style sheet that gives it its colour. */
  look: string;
}

/** What a session came to, what of it was not judged, and how that is to look. */
export function verdict(summary: Summary): Verdict {
  if (summary.outcome === "not judged") return { text: "Not judged", look: "quiet" };
  const titles = (outcome: string) => {
    const monitors = (summary.monitors ?? []).filter((monitor) => monitor.outcome === outcome);
    return monitors.map((monitor) => codeTitle(monitor.code)).join(", ");
  };
  const found = summary.faults.map((code) => faultFound(summary, code)).join(", ");
  const pending = titles("pending");
  const sound = titles("no fault");
  const unlearnt = titles("not learnt");
  const unjudged = titles("not judged");
  const rest = [unlearnt && `not learnt: ${unlearnt}`, unjudged && `not judged: ${unjudged}`].filter(Boolean);
  const text = (first: string) => capitalised([first, ...rest].filter(Boolean).join("; "));
  if (found) return { text: text(found), look: "status-confirmed" };
  if (pending) return { text: text(`Pending only: ${pending}`), look: "status-pending" };
  if (rest.length) return { text: text(sound && `No fault of ${sound}`), look: "quiet" };
  return { text: "No fault", look: "status-ok" };
}
