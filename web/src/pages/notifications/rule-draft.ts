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
  /** Beginning and end of the quiet hours, `hh:mm`; both empty for none. */
  quietFrom: string;
  quietTo: string;
  timeZone: string;
}

/** The time zone of the browser. */
const ownTimeZone = () => Intl.DateTimeFormat().resolvedOptions().timeZone || "UTC";

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
  quietFrom: "",
  quietTo: "",
  timeZone: ownTimeZone(),
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
  quiet_hours,
}: Rule): RuleDraft => ({
  name,
  asset: asset ?? "*",
  tag: tag ?? "",
  channel,
  codes: codes ?? [],
  changes: changes ?? [],
  delay: delay_s ?? 0,
  repeat: repeat_s ?? 0,
  quietFrom: quiet_hours?.from ?? "",
  quietTo: quiet_hours?.to ?? "",
  timeZone: quiet_hours?.time_zone ?? ownTimeZone(),
});

/** Whether the form can be saved. */
export const isComplete = ({ name, changes, quietFrom, quietTo }: RuleDraft) =>
  !!name.trim() && changes.length > 0 && !quietFrom === !quietTo;

/** The rule that the form describes; what the form does not hold is as `before`. */
export function ruleOf(draft: RuleDraft, before?: Rule): NewRule {
  const { delay, repeat, tag, quietFrom, quietTo, timeZone, ...settings } = draft;
  const { enabled = true, silent_until } = before ?? {};
  const quiet_hours = quietFrom && quietTo ? { from: quietFrom, to: quietTo, time_zone: timeZone } : null;
  const times = { delay_s: delay || null, repeat_s: repeat || null, quiet_hours };
  return { ...settings, ...times, tag: tag.trim() || null, enabled, silent_until };
}
