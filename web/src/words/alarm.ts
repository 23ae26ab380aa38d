/** Words about alarms. */
import type { Alarm, AlarmChange, AlarmCode } from "../api/alarms";
import { faultPath, rigPath } from "../router/paths";
import { codeTitle, faultTitle } from "./fault-names";
import { isPresent, presenceOf, statusWord } from "./fault-state";
import { sinceText } from "./time";

export const ALARM_CODES: AlarmCode[] = ["x_servo", "y_servo", "stuck_ball", "sensor", "communication_lost"];

export const CHANGES: Record<AlarmChange, string> = {
  pending: "suspected",
  confirmed: "confirmed",
  passed: "passing again",
  healed: "healed",
  cleared: "cleared by a person",
};

export const alarmCodeTitle = (code: AlarmCode) =>
  code === "communication_lost" ? "No data" : codeTitle(code);

export const alarmTitle = ({ code, ...kind }: Pick<Alarm, "code" | "kind" | "kind_weight">) =>
  code === "communication_lost" ? alarmCodeTitle(code) : faultTitle({ code, ...kind });

/** The view that shows more of an alarm. */
export const alarmPath = ({ asset, code }: Pick<Alarm, "asset" | "code">) =>
  code === "communication_lost" ? rigPath(asset) : faultPath(asset, code);

/** What the text about the state of an alarm rests on. */
type AlarmStanding = Pick<
  Alarm,
  "code" | "failing" | "tested" | "session_open" | "status" | "muted" | "acknowledgement"
> &
  Partial<Pick<Alarm, "communication_lost_since">>;

/** What an alarm is now, and the class of its look. */
export function alarmState(alarm: AlarmStanding) {
  const { code, failing, status, muted, acknowledgement, communication_lost_since: lost } = alarm;
  // Whether data arrive is tested all the same; only nobody is told.
  if (muted && code === "communication_lost") return { text: `muted by ${muted.by}`, look: "status-cleared" };
  if (muted) return { text: `not tested (muted by ${muted.by})`, look: "status-cleared" };
  // Whether data arrive is watched without a session, too.
  const isNow = code === "communication_lost" || isPresent(alarm, presenceOf(alarm));
  const silence = lost ? `; silent since ${sinceText(lost)}` : "";
  const isSuspected = failing && status === "pending";
  if (isSuspected)
    return { text: isNow ? "△ suspected" : `suspected when last tested${silence}`, look: "status-pending" };
  if (failing && code === "communication_lost") return { text: "▲ no data now", look: "status-confirmed" };
  if (failing)
    return { text: isNow ? "▲ failing" : `▲ failed when last tested${silence}`, look: "status-confirmed" };
  const isUnseen = code !== "communication_lost" && !acknowledgement;
  if (status === "healed")
    return { text: isUnseen ? "healed, not acknowledged" : "healed", look: "status-healed" };
  return { text: `passing again; was ${statusWord(status)}`, look: "status-pending" };
}
