import { alarmApi, type Channel } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";

/** Where a channel sends, in a few words. */
const target = ({ url, email }: Channel) => url ?? `${email?.to.join(", ")} by ${email?.host}:${email?.port}`;

export function ChannelRow({ channel, refetch }: { channel: Channel; refetch: () => Promise<unknown> }) {
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
