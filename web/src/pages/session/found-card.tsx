import type { FaultLine, Session } from "../../api/types";
import { Facts } from "../../parts/facts";
import { count } from "../../words/numbers";
import { sessionLength } from "../../words/session";
import { dateTime, duration } from "../../words/time";
import { verdict } from "../../words/verdict";
import { FoundFault } from "./found-fault";
import { Hash } from "./hash";
import { JudgedShares } from "./judged-shares";

interface Props {
  session: Session;
  faults: FaultLine[];
  seek: (t: number) => void;
}

/** The data of the session and its verdict. */
export function FoundCard({ session, faults, seek }: Props) {
  const { verdict: summary, rejected } = session;
  const result = summary && verdict(summary);
  const hash = summary && <Hash hash={summary.verdict_hash} title={summary.verdict_hash} />;
  return (
    <section class="card">
      <h2>Verdict</h2>
      <Facts
        facts={[
          ["State", session.state === "open" ? "open" : `ended ${dateTime(session.ended_at)}`],
          ["Samples", `${count(session.samples)}${rejected ? `, ${count(rejected)} rejected` : ""}`],
          ["Length", duration(sessionLength(session))],
          ["Hash", hash ?? "when the session has ended"],
        ]}
      />
      {result && <p class={result.look}>{result.text}</p>}
      {!result && faults.length === 0 && <p class="quiet">No fault so far</p>}
      {faults.length > 0 && (
        <ol class="found">
          {faults.map((line) => (
            <FoundFault line={line} seek={seek} />
          ))}
        </ol>
      )}
      {summary && <JudgedShares monitors={summary.monitors ?? []} />}
    </section>
  );
}
