import { useContext, useState } from "preact/hooks";
import type { Channel } from "../../api/alarms";
import { Dialog } from "../../parts/dialog";
import { HealthContext } from "../../parts/service-health";
import { ChannelForm } from "./channel-form";
import { ChannelTable } from "./channel-table";

export function ChannelsCard({
  channels,
  refetch,
}: {
  channels: Channel[];
  refetch: () => Promise<unknown>;
}) {
  const [isOpen, setOpen] = useState(false);
  const [secret, setSecret] = useState<string>();
  const hasNoLinks = useContext(HealthContext)?.message_links === false && channels.length > 0;
  const made = (secret?: string | null) => {
    setOpen(false);
    setSecret(secret ?? undefined);
    void refetch();
  };
  return (
    <section class="card">
      <h2>Channels</h2>
      {!channels.length && <p class="quiet">No channel yet: a webhook or e-mail that messages go to.</p>}
      {secret && (
        <p class="note" role="status">
          <span>
            Signing key (shown once): <code class="secret">{secret}</code>
          </span>
        </p>
      )}
      {hasNoLinks && (
        <p class="note">
          Messages have no link to the dashboard: the setting <code>notifications.public_url</code> is
          missing.
        </p>
      )}
      {channels.length > 0 && <ChannelTable channels={channels} refetch={refetch} />}
      <p>
        <button type="button" onClick={() => setOpen(true)}>
          Add a channel
        </button>
      </p>
      {isOpen && (
        <Dialog title="Add a channel" close={() => setOpen(false)}>
          <ChannelForm made={made} />
        </Dialog>
      )}
    </section>
  );
}
