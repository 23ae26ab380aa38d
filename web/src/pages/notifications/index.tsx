/** Who is told of alarms: channels, rules, and the deliveries. */
import { alarmApi } from "../../api/alarms";
import { ProblemError } from "../../api/request";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { Link } from "../../router/link";
import { ChannelsCard } from "./channels-card";
import { DeliveriesCard } from "./deliveries-card";
import { RulesCard } from "./rules-card";

const INTERVAL_MS = 3000;

/** Only administrators see the channels. */
const isForbidden = (error: unknown) => error instanceof ProblemError && error.status === 403;

export function NotificationsPage() {
  useTitle("Notifications");
  const channels = useQuery(alarmApi.channels, "channels", INTERVAL_MS);
  const rules = useQuery(alarmApi.rules, "rules", INTERVAL_MS);
  const deliveries = useQuery(() => alarmApi.deliveries(), "deliveries", INTERVAL_MS);
  const mayChange = !isForbidden(channels.error);
  const refetch = () => Promise.all([channels.refetch(), rules.refetch(), deliveries.refetch()]);
  return (
    <main>
      <header class="page-head">
        <h1>Notifications</h1>
        <div class="page-tools">
          <Link to="/alarms">Alarms</Link>
        </div>
      </header>
      {mayChange ? (
        <ErrorMessage error={channels.error} retry={channels.refetch} />
      ) : (
        <p class="note">Channels and rules can be changed by an administrator.</p>
      )}
      <ErrorMessage error={rules.error} retry={rules.refetch} />
      {mayChange && !channels.data && !channels.error && <Loading what="the channels" />}
      {channels.data && <ChannelsCard channels={channels.data} refetch={refetch} />}
      {rules.data && <RulesCard rules={rules.data} channels={channels.data} refetch={refetch} />}
      {deliveries.data && <DeliveriesCard deliveries={deliveries.data.items} />}
    </main>
  );
}
