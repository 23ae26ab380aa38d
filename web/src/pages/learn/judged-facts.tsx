import { useMemo } from "preact/hooks";
import type { Profile, Session, Trace } from "../../api/types";
import { useReplay } from "../../hooks/use-replay";
import { ActionButton } from "../../parts/action-button";
import { Facts } from "../../parts/facts";
import { count, NONE, number } from "../../words/numbers";
import { verdict } from "../../words/verdict";
import { sharesAlongX } from "./shares";

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
  const judgeAll = <ActionButton action={() => judge({ profile })}>Judge the whole session</ActionButton>;
  const whole = result ? verdict(result.summary).text : replay ? "judging…" : judgeAll;
  return (
    <Facts
      facts={[
        ["Beyond the limit", percent(shares?.beyond)],
        ["Judged (gate open)", percent(shares?.judged)],
        [
          "Beyond the limit, of the judged part",
          isGateClosed ? "none: the gate was never open" : percent(shares?.beyondOfJudged),
        ],
        ["Whole session", whole],
        ["Status changes", result ? count(result.faults.length) : NONE],
      ]}
    />
  );
}
