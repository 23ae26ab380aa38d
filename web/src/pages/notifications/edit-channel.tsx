import { useState } from "preact/hooks";
import type { Channel } from "../../api/alarms";
import { Dialog } from "../../parts/dialog";
import { ChannelForm } from "./channel-form";

/** Opens the form of a channel. */
export function EditChannel({ channel, refetch }: { channel: Channel; refetch: () => Promise<unknown> }) {
  const [isOpen, setOpen] = useState(false);
  const changed = () => {
    setOpen(false);
    void refetch();
  };
  return (
    <>
      <button type="button" class="small" aria-label={`Edit ${channel.name}`} onClick={() => setOpen(true)}>
        Edit
      </button>
      {isOpen && (
        <Dialog title={`Edit the channel ${channel.name}`} close={() => setOpen(false)}>
          <ChannelForm channel={channel} made={changed} />
        </Dialog>
      )}
    </>
  );
}
