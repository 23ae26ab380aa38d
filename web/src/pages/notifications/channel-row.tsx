import { alarmApi, type Channel } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ConfirmButton } from "../../parts/confirm-button";
import { EditChannel } from "./edit-channel";

/** Where a channel sends, in a few words. */
const target = ({ url, email }: Channel) => url ?? `${email?.to.join(", ")} by ${email?.host}:${email?.port}`;

export function ChannelRow({ channel, refetch }: { channel: Channel; refetch: () => Promise<unknown> }) {
  const { id, name, pending, given_up } = channel;
  const test = async () => {
    await alarmApi.testChannel(id);
    await refetch();
  };
  const remove = async () => {
    await alarmApi.deleteChannel(channel);
    await refetch();
  };
  return (
    <tr>
      <th scope="row">{name}</th>
      <td class="secret">{target(channel)}</td>
      <td class="n" data-word="waiting">
        {pending}
      </td>
      <td class={`n${given_up ? " bad" : ""}`} data-word="failed">
        {given_up}
      </td>
      <td>
        <ActionButton class="small" label={`Test ${name}`} action={test}>
          Test
        </ActionButton>{" "}
        <EditChannel channel={channel} refetch={refetch} />{" "}
        <ConfirmButton
          class="small"
          word="Delete"
          label={`Delete ${name}`}
          question={`Delete the channel ${name}?`}
          action={remove}
        >
          Messages that wait for it are not sent any more, and the list of those that were sent is deleted. A
          channel that a rule uses cannot be deleted.
        </ConfirmButton>
      </td>
    </tr>
  );
}
