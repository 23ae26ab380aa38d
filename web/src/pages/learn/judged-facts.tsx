import { useMemo } from "preact/hooks";
import type { FaultLine, Profile, Session, Trace } from "../../api/types";
import { useReplay } from "../../hooks/use-replay";
import { ActionButton } from "../../parts/action-button";
import { Facts } from "../../parts/facts";
import { count, NONE, number } from "../../words/numbers";
import { isFailing } from "../../words/status-byte";
import { verdict } from "../../words/verdict";
import { sharesAlongX } from "./shares";

/** Whether a line reports that a fault is confirmed, and not that its test passes again. */
const isAlarm = (line: FaultLine) => line.status === "confirmed" && isFailing(line);

const percent = (share?: number | null) => number(share == null ? share : 100 * share, 0, "%");

interface Props {
  session: Session;
  profile: Profile;
  trace?: Trace;
}

/** The result of a profile for the shown part and, on request, for the whole session. */
export function JudgedFacts({ session, profile, trace }: Props) {
  const shares = useMemo(() => trace && sharesAlongX(trace), [trace]);
  const { replay, judge } = useReplay(session.id);
  const result = replay?.result;
  const isGateClosed = shares && !shares.judged;
  const judgeAll = (
    <ActionButton action={() => judge({ profile })} needs="operator">
      Run on the whole session
    </ActionButton>
  );
  const whole = result
    ? verdict(result.summary, result.faults, profile).text
    : replay
      ? "running…"
      : judgeAll;
  return (
    <Facts
      facts={[
        ["Beyond the limit", percent(shares?.beyond)],
        ["Time judged", percent(shares?.judged)],
        ["Beyond the limit while judged", isGateClosed ? "never judged" : percent(shares?.beyondOfJudged)],
        ["Whole session", whole],
        ["Alarms in the whole session", result ? count(result.faults.filter(isAlarm).length) : NONE],
      ]}
    />
  );
}
