import type { Replay, Session } from "../../api/types";
import { Facts } from "../../parts/facts";
import { count } from "../../words/numbers";
import { verdict } from "../../words/verdict";
import { Differences } from "./differences";
import { Hash } from "./hash";

type Result = NonNullable<Replay["result"]>;

/** The recorded verdict and that of the replay. */
export function ReplayVerdict({ session, result }: { session: Session; result: Result }) {
  const { same, differences, recorded_hash, summary } = result;
  const recorded = session.verdict ? verdict(session.verdict).text : "when the session has ended";
  return (
    <div class="verdicts">
      <p role="status" class={same ? "status-ok" : "status-pending"}>
        {same
          ? "The same verdict, transition by transition."
          : `Another verdict: ${count(differences.length)} differences.`}
      </p>
      <div class="pair">
        <Facts
          facts={[
            ["Recorded", recorded],
            ["Verdict hash", <Hash hash={recorded_hash} />],
          ]}
        />
        <Facts
          facts={[
            ["Judged again", verdict(summary).text],
            ["Verdict hash", <Hash hash={summary.verdict_hash} />],
          ]}
        />
      </div>
      {differences.length > 0 && <Differences differences={differences} />}
    </div>
  );
}
