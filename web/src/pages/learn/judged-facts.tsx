import { useMemo } from "preact/hooks";
import type { Session, Trace } from "../../api/types";
import { useReplay } from "../../hooks/use-replay";
import { ActionButton } from "../../parts/action-button";
import { Facts } from "../../parts/facts";
import { count, NONE, number } from "../../words/numbers";
import { verdict } from "../../words/verdict";
import { sharesAlongX } from "./shares";

const percent = (share?: number | null) => number(share == null ? share : 100 * share, 0, "%");

interface Props {
  session: Session;
  profile: string;
  trace?: Trace;
}

/** What a profile makes of the seconds that are shown and, if asked to, of the whole session. */
export function JudgedFacts({ session, profile, trace }: Props) {
  const shares = useMemo(() => trace && sharesAlongX(trace), [trace]);
  const { replay, judge } = useReplay(session.id);
  const result = replay?.result;
  const isGateClosed = shares && !shares.judged;
  const judgeAll = <ActionButton action={() => judge({ profile })}>Judge it all</ActionButton>;
  const whole = result ? verdict(result.summary).text : replay ? "judging…" : judgeAll;
  return (
    <Facts
      facts={[
        ["Beyond the limit", percent(shares?.beyond)],
        ["Judged: the gate is open", percent(shares?.judged)],
        [
          "Beyond the limit, of what is judged",
          isGateClosed ? "nothing: the gate never opened" : percent(shares?.beyondOfJudged),
        ],
        ["Whole session", whole],
        ["Changes of status", result ? count(result.faults.length) : NONE],
      ]}
    />
  );
}
