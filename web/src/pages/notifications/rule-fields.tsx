import type { Channel } from "../../api/alarms";
import { Choice } from "../../parts/choice";
import { duration } from "../../words/time";
import type { RuleDraft } from "./rule-draft";

/** Intervals of reminders, s. */
const REPEATS = [
  [0, "Never"],
  [900, "Every 15 minutes"],
  [3600, "Every hour"],
  [86_400, "Every day"],
] as const;

/** Times for which a fault must fail before the first message is sent, s. */
const DELAYS = [
  [0, "At once"],
  [60, "After 1 minute"],
  [300, "After 5 minutes"],
  [900, "After 15 minutes"],
  [3600, "After 1 hour"],
] as const;

type Times = readonly (readonly [number, string])[];

/** The times to choose from, with that of a rule that was made elsewhere. */
const withOwn = (times: Times, own: number, word: string): Times =>
  times.some(([s]) => s === own) ? times : [...times, [own, `${word} ${duration(own)}`]];

interface Props {
  draft: RuleDraft;
  channels: Channel[];
  change: (part: Partial<RuleDraft>) => void;
}

/** Name, rigs, tag, channel, delay, reminders and quiet hours of a rule. */
export function RuleFields({ draft, channels, change }: Props) {
  return (
    <div class="form-row">
      <label>
        Name
        <input value={draft.name} maxLength={100} onInput={(e) => change({ name: e.currentTarget.value })} />
      </label>
      <label>
        Rigs (* stands for any characters)
        <input
          value={draft.asset}
          maxLength={200}
          onInput={(e) => change({ asset: e.currentTarget.value })}
        />
      </label>
      <label>
        With the tag
        <input
          value={draft.tag}
          maxLength={50}
          placeholder="any"
          onInput={(e) => change({ tag: e.currentTarget.value })}
        />
      </label>
      <Choice
        label="Channel"
        value={draft.channel}
        options={channels.map(({ id, name }) => [id, name] as const)}
        change={(channel) => change({ channel })}
      />
      <Choice
        label="Sent if it still fails"
        value={draft.delay}
        options={withOwn(DELAYS, draft.delay, "After")}
        change={(delay) => change({ delay })}
      />
      <Choice
        label="Repeated while it fails"
        value={draft.repeat}
        options={withOwn(REPEATS, draft.repeat, "Every")}
        change={(repeat) => change({ repeat })}
      />
      <QuietHours draft={draft} change={change} />
    </div>
  );
}

function QuietHours({ draft, change }: Omit<Props, "channels">) {
  return (
    <>
      <label>
        Nothing is sent from
        <input
          type="time"
          value={draft.quietFrom}
          onInput={(e) => change({ quietFrom: e.currentTarget.value })}
        />
      </label>
      <label>
        to ({draft.timeZone})
        <input
          type="time"
          value={draft.quietTo}
          onInput={(e) => change({ quietTo: e.currentTarget.value })}
        />
      </label>
    </>
  );
}
