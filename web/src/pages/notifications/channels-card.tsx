import { useState } from "preact/hooks";
import { alarmApi, type Channel } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { Dialog } from "../../parts/dialog";
import { ChannelForm } from "./channel-form";

/** Where a channel sends, in a few words. */
const target = ({ url, email }: Channel) => url ?? `${email?.to.join(", ")} by ${email?.host}:${email?.port}`;

export function ChannelsCard({
  channels,
  refetch,
}: {
  channels: Channel[];
  refetch: () => Promise<unknown>;
}) {
  const [isOpen, setOpen] = useState(false);
  const [secret, setSecret] = useState<string>();
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
            The key of the signature, shown only now: <code class="secret">{secret}</code>
          </span>
        </p>
      )}
      {channels.length > 0 && (
        <div class="scroll">
          <table class="list alarms">
            <thead>
              <tr>
                <th>Name</th>
                <th>Sends to</th>
                <th class="n">Waiting</th>
                <th class="n">Given up</th>
                <th>Actions</th>
              </tr>
            </thead>
            <tbody>
              {channels.map((channel) => (
                <ChannelRow key={channel.id} channel={channel} refetch={refetch} />
              ))}
            </tbody>
          </table>
        </div>
      )}
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

function ChannelRow({ channel, refetch }: { channel: Channel; refetch: () => Promise<unknown> }) {
  const { id, name, pending, given_up } = channel;
  const test = async () => {
    await alarmApi.testChannel(id);
    await refetch();
  };
  const remove = async () => {
    await alarmApi.deleteChannel(id);
    await refetch();
  };
  return (
    <tr>
      <th scope="row">{name}</th>
      <td class="secret">{target(channel)}</td>
      <td class="n" data-word="waiting">
        {pending}
      </td>
      <td class={`n${given_up ? " bad" : ""}`} data-word="given up">
        {given_up}
      </td>
      <td>
        <ActionButton class="small" label={`Test ${name}`} action={test}>
          Test
        </ActionButton>{" "}
        <ActionButton class="small" label={`Delete ${name}`} action={remove}>
          Delete
        </ActionButton>
      </td>
    </tr>
  );
}
