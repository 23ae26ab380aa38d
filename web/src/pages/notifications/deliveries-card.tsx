import type { Delivery } from "../../api/alarms";
import { useNow } from "../../hooks/use-now";
import { deliverySummary } from "../../words/sentence";
import { timeAgo, dateTime } from "../../words/time";

/** The state of a delivery, and the class of its look. */
function stateOf({ state, attempts }: Delivery): { text: string; look: string } {
  if (state === "delivered") return { text: "delivered", look: "status-ok" };
  if (state === "given_up") return { text: "failed", look: "status-confirmed" };
  return attempts ? { text: "retrying", look: "status-pending" } : { text: "waiting", look: "quiet" };
}

export function DeliveriesCard({ deliveries }: { deliveries: Delivery[] }) {
  const now = useNow();
  return (
    <section class="card">
      <h2>Deliveries</h2>
      {!deliveries.length && <p class="quiet">No message yet.</p>}
      {deliveries.length > 0 && (
        <div class="scroll">
          <table class="list alarms">
            <thead>
              <tr>
                <th>Message</th>
                <th>Channel</th>
                <th>State</th>
                <th class="n">Attempts</th>
                <th>Created</th>
              </tr>
            </thead>
            <tbody>
              {deliveries.map((delivery) => (
                <DeliveryRow key={delivery.id} delivery={delivery} now={now} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}

function DeliveryRow({ delivery, now }: { delivery: Delivery; now: number }) {
  const { text, look } = stateOf(delivery);
  const next = delivery.attempts && delivery.next_attempt_at ? dateTime(delivery.next_attempt_at) : "";
  return (
    <tr>
      <td>{deliverySummary(delivery.summary)}</td>
      <td data-word="by">{delivery.channel_name ?? "–"}</td>
      <td>
        <span class={look}>{text}</span>
        {delivery.error && <p class="quiet small-text">{delivery.error}</p>}
        {next && <p class="quiet small-text">next attempt {next}</p>}
      </td>
      <td class="n" data-word="attempts">
        {delivery.attempts}
      </td>
      <td data-word="created" title={dateTime(delivery.created_at)}>
        {timeAgo(delivery.created_at, now)}
      </td>
    </tr>
  );
}
