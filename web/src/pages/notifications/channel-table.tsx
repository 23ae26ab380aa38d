import type { Channel } from "../../api/alarms";
import { ChannelRow } from "./channel-row";

interface Props {
  channels: Channel[];
  refetch: () => Promise<unknown>;
}

export function ChannelTable({ channels, refetch }: Props) {
  return (
    <div class="scroll">
      <table class="list alarms">
        <thead>
          <tr>
            <th>Name</th>
            <th>Sends to</th>
            <th class="n">Waiting</th>
            <th class="n">Failed</th>
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
  );
}
