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

/** The intervals, with that of a rule that was made elsewhere. */
const repeats = (own: number): (readonly [number, string])[] =>
  REPEATS.some(([s]) => s === own) ? [...REPEATS] : [...REPEATS, [own, `Every ${duration(own)}`]];

interface Props {
  draft: RuleDraft;
  channels: Channel[];
  change: (part: Partial<RuleDraft>) => void;
}

/** Name, rigs, tag, channel and reminders of a rule. */
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
        label="Repeated while it fails"
        value={draft.repeat}
        options={repeats(draft.repeat)}
        change={(repeat) => change({ repeat })}
      />
    </div>
  );
}
