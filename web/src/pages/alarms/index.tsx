/** The alarms of the fleet: what fails now, what is on record, and what to do. */
import { useTitle } from "../../hooks/use-title";
import { EmptyState } from "../../parts/empty-state";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { SavedViews } from "../../parts/saved-views/saved-views";
import { Link } from "../../router/link";
import { AcknowledgeTools } from "./acknowledge-tools";
import { AlarmList } from "./alarm-list";
import { AlarmTools } from "./alarm-tools";
import { chosenAlarms } from "./arranged";
import { UnseenNote } from "./unseen-note";
import { useAcknowledge } from "./use-acknowledge";
import { useAlarmFilter } from "./use-alarm-filter";
import { useAlarms } from "./use-alarms";

export function AlarmsPage() {
  const { filter, word, change } = useAlarmFilter();
  const { alarms: all, error, refetch } = useAlarms(filter);
  const alarms = chosenAlarms(all ?? [], word("rig"), word("sort"));
  useTitle("Alarms");
  const { chosen, choose, open, refused, acknowledge } = useAcknowledge(alarms, refetch);
  return (
    <main>
      <header class="page-head">
        <h1>Alarms</h1>
        <div class="page-tools">
          <Link to="/notifications">Notifications</Link>
          <SavedViews page="/alarms" />
          <AcknowledgeTools open={open} acknowledge={acknowledge} />
        </div>
      </header>
      <AlarmTools filter={filter} word={word} change={change} />
      <ErrorMessage error={error} retry={refetch} />
      <UnseenNote isListed={filter.state === "all"} />
      {refused.length > 0 && (
        <p class="trouble" role="alert">
          Not acknowledged: {refused.join("; ")}
        </p>
      )}
      {!all && !error && <Loading what="the alarms" />}
      {all && !alarms.length && (
        <EmptyState title="No alarms">
          <p>No alarm matches this filter.</p>
        </EmptyState>
      )}
      {alarms.length > 0 && (
        <AlarmList alarms={alarms} group={word("group")} chosen={chosen} choose={choose} />
      )}
    </main>
  );
}
