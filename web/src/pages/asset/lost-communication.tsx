import { alarmApi, type Alarm } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";
import { dateTime, sinceText } from "../../words/time";
import { MuteButton } from "./mute-button";

interface Props {
  alarm: Alarm;
  refetch: () => Promise<unknown>;
}

/** Says that data of the rig stay away: since when, and who knows of it. */
export function LostCommunication({ alarm, refetch }: Props) {
  const { asset, code, since, acknowledgement, muted } = alarm;
  const actor = useActor();
  const acknowledge = async () => {
    actor.remember();
    const { items } = await alarmApi.acknowledge([{ asset, code }]);
    const refused = items.find((item) => !item.acknowledged);
    if (refused) throw new Error(refused.reason ?? "It was not acknowledged.");
    await refetch();
  };
  const isOpen = !acknowledgement && !muted;
  return (
    <div class={muted ? "note" : "trouble"} role="alert">
      <span>
        <b>No data{since && ` since ${sinceText(since)}`}</b>, though a session is open.{" "}
        {acknowledgement && `Acknowledged by ${acknowledgement.by}, ${dateTime(acknowledgement.at)}.`}
        {muted && ` Muted by ${muted.by} until ${dateTime(muted.until)}: ${muted.reason}`}
      </span>
      {isOpen && <ActorField actor={actor} />}
      <MuteButton asset={asset} code={code} mute={muted} changed={refetch} />
      {isOpen && (
        <ActionButton class="small" action={acknowledge} needs="operator">
          Acknowledge
        </ActionButton>
      )}
    </div>
  );
}
