import { useState } from "preact/hooks";
import { alarmApi, type AlarmChange, type AlarmCode, type Channel, type NewRule } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ALARM_CODES, alarmCodeTitle, CHANGES } from "../../words/alarm";

/** Intervals of reminders, s. */
const REPEATS = [
  [0, "Never"],
  [900, "Every 15 minutes"],
  [3600, "Every hour"],
  [86_400, "Every day"],
] as const;

/** Returns `list` with `item` added or, if it is there, removed. */
const toggled = <T,>(list: T[], item: T) =>
  list.includes(item) ? list.filter((other) => other !== item) : [...list, item];

export function RuleForm({ channels, made }: { channels: Channel[]; made: () => void }) {
  const [name, setName] = useState("");
  const [asset, setAsset] = useState("*");
  const [channel, setChannel] = useState(channels[0]?.id ?? "");
  const [codes, setCodes] = useState<AlarmCode[]>([]);
  const [changes, setChanges] = useState<AlarmChange[]>(["confirmed", "passed"]);
  const [repeat, setRepeat] = useState(0);
  const save = async () => {
    const rule: NewRule = { name, asset, channel, codes, changes, repeat_s: repeat || null, enabled: true };
    await alarmApi.createRule(rule);
    made();
  };
  return (
    <>
      <div class="form-row">
        <label>
          Name
          <input value={name} maxLength={100} onInput={(e) => setName(e.currentTarget.value)} />
        </label>
        <label>
          Rigs (* stands for any characters)
          <input value={asset} maxLength={200} onInput={(e) => setAsset(e.currentTarget.value)} />
        </label>
        <label>
          Channel
          <select value={channel} onChange={(e) => setChannel(e.currentTarget.value)}>
            {channels.map(({ id, name }) => (
              <option value={id}>{name}</option>
            ))}
          </select>
        </label>
        <label>
          Repeated while it fails
          <select value={repeat} onChange={(e) => setRepeat(Number(e.currentTarget.value))}>
            {REPEATS.map(([value, word]) => (
              <option value={value}>{word}</option>
            ))}
          </select>
        </label>
      </div>
      <fieldset>
        <legend>Faults (all if none is chosen)</legend>
        <div class="choices">
          {ALARM_CODES.map((code) => (
            <label class="check">
              <input
                type="checkbox"
                checked={codes.includes(code)}
                onChange={() => setCodes(toggled(codes, code))}
              />
              {alarmCodeTitle(code)}
            </label>
          ))}
        </div>
      </fieldset>
      <fieldset>
        <legend>Told when a fault</legend>
        <div class="choices">
          {(Object.keys(CHANGES) as AlarmChange[]).map((change) => (
            <label class="check">
              <input
                type="checkbox"
                checked={changes.includes(change)}
                onChange={() => setChanges(toggled(changes, change))}
              />
              {CHANGES[change]}
            </label>
          ))}
        </div>
      </fieldset>
      <div class="form-end">
        <ActionButton class="primary" disabled={!name.trim() || !changes.length} action={save}>
          Add
        </ActionButton>
      </div>
    </>
  );
}
