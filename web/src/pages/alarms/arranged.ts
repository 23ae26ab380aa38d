/** Which alarms of the list are shown, in which order, under which headings. */
import type { Alarm } from "../../api/alarms";
import { alarmCodeTitle, alarmTitle } from "../../words/alarm";
import { sinceText } from "../../words/time";

export const ORDERS = {
  "": "Latest change first",
  began: "Began last first",
  oldest: "Began first first",
  rig: "By rig",
  fault: "By fault",
} as const;

export const GROUPS = {
  "": "None",
  fault: "Fault",
  minute: "Minute of the beginning",
  rig: "Rig",
  tag: "Tag",
} as const;

/** Sorts bench-2 before bench-10. */
const NAMES = new Intl.Collator("en", { numeric: true });

const began = (alarm: Alarm) => alarm.since ?? "";

const COMPARE: Record<string, (a: Alarm, b: Alarm) => number> = {
  began: (a, b) => began(b).localeCompare(began(a)),
  oldest: (a, b) => began(a).localeCompare(began(b)),
  rig: (a, b) => NAMES.compare(a.asset, b.asset),
  fault: (a, b) => alarmTitle(a).localeCompare(alarmTitle(b)),
};

/** The tags of each rig that has any. */
export type RigTags = Map<string, string[]>;

/** The groups to which an alarm belongs: one, except that a rig may have several tags. */
const HEADINGS: Record<string, (alarm: Alarm, tags: RigTags) => string[]> = {
  fault: ({ code }) => [alarmCodeTitle(code)],
  minute: ({ since }) => [since ? `Began ${sinceText(since)}` : "Beginning not known"],
  rig: ({ asset }) => [asset],
  tag: ({ asset }, tags) => tags.get(asset) ?? ["Without a tag"],
};

export interface AlarmGroup {
  /** Empty if the alarms are not grouped. */
  heading: string;
  /** Those that are shown, and the number of all. */
  alarms: Alarm[];
  total: number;
}

/** Returns the alarms of the rigs whose names contain `rig`, in an order of `ORDERS`. */
export function chosenAlarms(alarms: Alarm[], rig: string, order: string): Alarm[] {
  const part = rig.toLowerCase();
  const found = alarms.filter(({ asset }) => asset.toLowerCase().includes(part));
  const compare = COMPARE[order];
  return compare ? found.sort(compare) : found;
}

/**
 * Returns the alarms by a grouping of `GROUPS`: the groups in the order of their first alarms, and of all of them
 * together the first `shown`.
 */
export function grouped(
  alarms: Alarm[],
  by: string,
  tags: RigTags = new Map(),
  shown = Infinity,
): AlarmGroup[] {
  const headings = HEADINGS[by] ?? (() => [""]);
  const groups = new Map<string, Alarm[]>();
  for (const alarm of alarms)
    for (const title of headings(alarm, tags)) {
      const group = groups.get(title);
      if (group) group.push(alarm);
      else groups.set(title, [alarm]);
    }
  let room = shown;
  const cut = [...groups].map(([heading, all]) => {
    const group = { heading, alarms: all.slice(0, room), total: all.length };
    room -= group.alarms.length;
    return group;
  });
  return cut.filter((group) => group.alarms.length > 0);
}
