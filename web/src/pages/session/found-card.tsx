import type { Asset, FaultLine, Session } from "../../api/types";
import { Facts } from "../../parts/facts";
import { count } from "../../words/numbers";
import { sessionLength } from "../../words/session";
import { dateTime, duration } from "../../words/time";
import { verdict } from "../../words/verdict";
import { Assumptions } from "./assumptions";
import { FoundFault } from "./found-fault";
import { Hash } from "./hash";
import { JudgedShares } from "./judged-shares";

interface Props {
  session: Session;
  asset: Asset;
  faults: FaultLine[];
  /** Goes to a moment of the playback, if there is one. */
  seek?: (t: number) => void;
}

/** The verdict on the session, what it rests on, and the data of the session. */
export function FoundCard({ session, asset, faults, seek }: Props) {
  const { verdict: summary, rejected } = session;
  const result = summary && verdict(summary, faults);
  const hash = summary && <Hash hash={summary.verdict_hash} title={summary.verdict_hash} />;
  return (
    <section class="card verdict">
      <h2>Verdict</h2>
      {result && <p class={`result ${result.look}`}>{result.text}</p>}
      {!result && <p class="quiet">The session is open. {faults.length === 0 && "No fault so far."}</p>}
      <Assumptions session={session} asset={asset} />
      {faults.length > 0 && (
        <ol class="found">
          {faults.map((line) => (
            <FoundFault line={line} seek={seek} />
          ))}
        </ol>
      )}
      {summary && <JudgedShares monitors={summary.monitors ?? []} />}
      <Facts
        facts={[
          ["State", session.state === "open" ? "open" : `ended ${dateTime(session.ended_at)}`],
          ["Samples", `${count(session.samples)}${rejected ? `, ${count(rejected)} rejected` : ""}`],
          ["Length", duration(sessionLength(session))],
          ["Verdict hash", hash ?? "when the session has ended"],
        ]}
      />
    </section>
  );
}
