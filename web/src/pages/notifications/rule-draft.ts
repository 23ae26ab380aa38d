import type { AlarmChange, AlarmCode, NewRule } from "../../api/alarms";

/** What the form of a rule holds. */
export interface RuleDraft {
  name: string;
  asset: string;
  /** Only rigs with this tag; empty for all. */
  tag: string;
  channel: string;
  codes: AlarmCode[];
  changes: AlarmChange[];
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
  repeat: 0,
});

/** The rule that the form describes. */
export function ruleOf({ repeat, tag, ...settings }: RuleDraft): NewRule {
  return { ...settings, tag: tag.trim() || null, repeat_s: repeat || null, enabled: true };
}
