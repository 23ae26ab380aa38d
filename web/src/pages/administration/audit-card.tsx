import type { AuditEntry } from "../../api/administration";
import type { Pages } from "../../hooks/use-pages";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { Link } from "../../router/link";
import { dateTime } from "../../words/time";
import { actText, auditTarget } from "./audit-target";

interface Props {
  list: Pages<AuditEntry>;
  /** Names a token by its id, if it is known. */
  tokenName: (id: string) => string | undefined;
}

/** The audit log, the latest action first. */
export function AuditCard({ list, tokenName }: Props) {
  const { items: entries, error, refetch, loadMore } = list;
  return (
    <section class="card">
      <h2>Audit log</h2>
      <p class="quiet">Who changed what, the latest first. Refusals are in the service log.</p>
      <ErrorMessage error={error} retry={refetch} />
      {!entries && !error && <Loading what="the audit log" />}
      {entries?.length === 0 && <p class="quiet">Nothing yet.</p>}
      {entries && entries.length > 0 && (
        <div class="scroll">
          <table class="list alarms">
            <thead>
              <tr>
                <th>Time</th>
                <th>Who</th>
                <th>Action</th>
                <th>On</th>
                <th>From</th>
              </tr>
            </thead>
            <tbody>
              {entries.map((entry) => (
                <AuditRow key={entry.id} entry={entry} tokenName={tokenName} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {loadMore && (
        <p>
          <ActionButton action={loadMore}>Show more</ActionButton>
        </p>
      )}
    </section>
  );
}

function AuditRow({ entry, tokenName }: { entry: AuditEntry; tokenName: Props["tokenName"] }) {
  const { text, path } = auditTarget(entry, tokenName);
  return (
    <tr>
      <td>{dateTime(entry.at)}</td>
      <th scope="row">{entry.actor}</th>
      <td>{actText(entry.act)}</td>
      <td class="target">{path ? <Link to={path}>{text}</Link> : text}</td>
      <td data-word="from">{entry.address ?? "–"}</td>
    </tr>
  );
}
