/** The alarms of the fleet: what fails now, what is on record, and what to do. */
import { alarmApi } from "../../api/alarms";
import { useNow } from "../../hooks/use-now";
import { useQuery } from "../../hooks/use-query";
import { useTitle, withNumber } from "../../hooks/use-title";
import { ActionButton } from "../../parts/action-button";
import { EmptyState } from "../../parts/empty-state";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { SavedViews } from "../../parts/saved-views/saved-views";
import { Link } from "../../router/link";
import { AcknowledgeTools } from "./acknowledge-tools";
import { AlarmTable } from "./alarm-table";
import { AlarmTools } from "./alarm-tools";
import { useAcknowledge } from "./use-acknowledge";
import { useAlarmFilter } from "./use-alarm-filter";
import { useAlarms } from "./use-alarms";

export function AlarmsPage() {
  const { filter, hours, change } = useAlarmFilter();
  const { alarms, error, refetch, loadMore } = useAlarms(filter);
  useTitle(withNumber("Alarms", alarms?.length ?? 0, loadMore !== undefined));
  const { chosen, choose, open, refused, acknowledge } = useAcknowledge(alarms ?? [], refetch);
  const advice = useQuery(alarmApi.advice, "advice");
  const now = useNow();
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
      <AlarmTools filter={filter} hours={hours} change={change} />
      <ErrorMessage error={error} retry={refetch} />
      {refused.length > 0 && (
        <p class="trouble" role="alert">
          Not acknowledged: {refused.join("; ")}
        </p>
      )}
      {!alarms && !error && <Loading what="the alarms" />}
      {alarms?.length === 0 && (
        <EmptyState title="No alarms">
          <p>No alarm matches this filter.</p>
        </EmptyState>
      )}
      {alarms && alarms.length > 0 && (
        <AlarmTable
          alarms={alarms}
          now={now}
          advice={advice.data}
          refetchAdvice={advice.refetch}
          chosen={chosen}
          choose={choose}
        />
      )}
      {loadMore && (
        <p>
          <ActionButton action={loadMore}>Show more</ActionButton>
        </p>
      )}
    </main>
  );
}
