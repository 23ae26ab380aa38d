/** The sentences of fault lines. */
import type { FaultLine } from "../api/types";
import { CODES, codeTitle } from "./fault-names";
import { isRepair, statusWord } from "./fault-state";
import { dateTime } from "./time";

/** Returns the summary of a fault line as a sentence, without its leading code. */
export function sentence(summary: string): string {
  const text = summary.replace(/^[^:]*: /, "").replace(/-(?=\d)/g, "−");
  return `${capitalised(text)}.`;
}

export const capitalised = (text: string) => text.charAt(0).toUpperCase() + text.slice(1);

/** Returns what a line reports as a sentence: what was seen, or what became of the fault. */
export function lineSentence(line: Pick<FaultLine, "status" | "status_byte" | "summary">): string {
  if (isRepair(line)) return `Passing again; was ${statusWord(line.status)}.`;
  if (line.status === "healed") return "Enough sessions without the fault followed.";
  if (line.status === "cleared") return "It was removed from the fault memory.";
  return sentence(line.summary);
}

/** A time of the service, as in ISO 8601. */
const MOMENT = /\d{4}-\d\d-\d\dT[\d:.]+Z/g;

/** Returns the summary of a message, which names rig, fault code and times, as text for people. */
export function deliverySummary(summary: string): string {
  const [, rig = "", rest = summary] = /^([^:]*: )(.*)$/s.exec(summary) ?? [];
  const titled = CODES.reduce((text, code) => text.replaceAll(code, codeTitle(code)), rest);
  return rig + titled.replace(MOMENT, dateTime).replace(/(?<=\s)-(?=\d)/g, "−");
}
