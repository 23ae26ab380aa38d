import type { AlarmChange, AlarmCode, NewRule, Rule } from "../../api/alarms";

/** What the form of a rule holds. */
export interface RuleDraft {
  name: string;
  asset: string;
  /** Only rigs with this tag; empty for all. */
  tag: string;
  channel: string;
  codes: AlarmCode[];
  changes: AlarmChange[];
  /** Time for which a fault must fail before it is told, s; 0 for none. */
  delay: number;
  /** Interval of reminders, s; 0 for none. */
  repeat: number;
}

/** What the form holds at first. */
export const firstDraft = (channel: string): RuleDraft => ({
  name: "",
  asset: "*",
  tag: "",
  channel,
  codes: [],
  changes: ["confirmed", "passed"],
  delay: 0,
  repeat: 0,
});

/** What the form of a rule that is there holds at first. */
export const draftOf = ({
  name,
  asset,
  tag,
  channel,
  codes,
  changes,
  delay_s,
  repeat_s,
}: Rule): RuleDraft => ({
  name,
  asset: asset ?? "*",
  tag: tag ?? "",
  channel,
  codes: codes ?? [],
  changes: changes ?? [],
  delay: delay_s ?? 0,
  repeat: repeat_s ?? 0,
});

/** The rule that the form describes; what the form does not hold is as `before`. */
export function ruleOf({ delay, repeat, tag, ...settings }: RuleDraft, before?: Rule): NewRule {
  const { enabled = true, silent_until } = before ?? {};
  const times = { delay_s: delay || null, repeat_s: repeat || null };
  return { ...settings, ...times, tag: tag.trim() || null, enabled, silent_until };
}
