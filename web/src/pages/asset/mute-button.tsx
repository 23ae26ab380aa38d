import { useState } from "preact/hooks";
import { alarmApi, type AlarmCode, type Mute } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";
import { Choice } from "../../parts/choice";
import { Dialog } from "../../parts/dialog";
import { useRefusal } from "../../parts/login/rights";
import { alarmCodeTitle } from "../../words/alarm";
import { dateTime } from "../../words/time";

/** Durations of a mute, hours. */
const DURATIONS = [
  [1, "one hour"],
  [8, "8 hours"],
  [24, "a day"],
  [168, "a week"],
  [720, "30 days"],
] as const;

const hoursFromNow = (hours: number) => new Date(Date.now() + hours * 3_600_000).toISOString();

interface Props {
  asset: string;
  code: AlarmCode;
  mute?: Mute | null;
  /** Called after a change that no stream tells. */
  changed?: () => Promise<unknown>;
}

/** Mutes a monitor of a rig, or the alarm of lost communication; or ends the mute. */
export function MuteButton({ asset, code, mute, changed }: Props) {
  const [isOpen, setOpen] = useState(false);
  const refused = useRefusal("operator");
  if (mute)
    return (
      <ActionButton
        class="small"
        label={`End the mute of ${alarmCodeTitle(code)}: ${mute.reason}, until ${dateTime(mute.until)}`}
        action={async () => {
          await alarmApi.unmute(mute);
          await changed?.();
        }}
        needs="operator"
      >
        Unmute
      </ActionButton>
    );
  return (
    <>
      <button
        type="button"
        class="small"
        aria-label={`Mute ${alarmCodeTitle(code)}`}
        disabled={refused !== undefined}
        title={refused}
        onClick={() => setOpen(true)}
      >
        Mute
      </button>
      {isOpen && <MuteDialog asset={asset} code={code} changed={changed} close={() => setOpen(false)} />}
    </>
  );
}

const MONITOR_EFFECT =
  "The monitor is shown as not tested, and what it finds causes no notification. It is still recorded.";
const COMMUNICATION_EFFECT = "No notification is sent if data stop. The page and the history still show it.";

function MuteDialog({ asset, code, changed, close }: Omit<Props, "mute"> & { close: () => void }) {
  const [reason, setReason] = useState("");
  const [hours, setHours] = useState(8);
  const actor = useActor();
  const save = async () => {
    actor.remember();
    await alarmApi.mute(asset, code, reason.trim(), hoursFromNow(hours));
    close();
    await changed?.();
  };
  return (
    <Dialog title={`Mute ${alarmCodeTitle(code)} of ${asset}`} close={close}>
      <p class="quiet">
        {code === "communication_lost" ? COMMUNICATION_EFFECT : MONITOR_EFFECT} The mute ends by itself.
      </p>
      <div class="form-row">
        <label>
          Why
          <input value={reason} maxLength={200} onInput={(e) => setReason(e.currentTarget.value)} />
        </label>
        <Choice<number> label="For" options={DURATIONS} value={hours} change={setHours} />
      </div>
      <div class="form-end">
        <ActorField actor={actor} />
        <ActionButton class="primary" disabled={!reason.trim()} action={save} needs="operator">
          Mute
        </ActionButton>
      </div>
    </Dialog>
  );
}
