import type { FaultLine, Replay, Session } from "../../api/types";
import { Facts } from "../../parts/facts";
import { plural } from "../../words/numbers";
import { verdict } from "../../words/verdict";
import { Differences } from "./differences";
import { Hash } from "./hash";

interface Props {
  session: Session;
  /** The fault lines of the record. */
  faults: FaultLine[];
  result: NonNullable<Replay["result"]>;
  /** The profile that was asked for, if not that of the session. */
  profile?: string | null;
}

/** The recorded verdict and that of the replay. */
export function ReplayVerdict({ session, faults, result, profile }: Props) {
  const { same, differences, recorded_hash, summary } = result;
  const recorded = session.verdict ? verdict(session.verdict, faults).text : "when the session has ended";
  return (
    <div class="verdicts">
      <p role="status" class={same ? "status-ok" : "status-pending"}>
        {same ? "Identical verdict." : `Different verdict: ${plural(differences.length, "change")}.`}
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
            ["Judged again", verdict(summary, result.faults, profile).text],
            ["Verdict hash", <Hash hash={summary.verdict_hash} />],
          ]}
        />
      </div>
      {differences.length > 0 && <Differences differences={differences} />}
    </div>
  );
}
