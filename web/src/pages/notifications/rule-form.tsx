import { useState } from "preact/hooks";
import { alarmApi, type AlarmChange, type Channel, type Rule } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ALARM_CODES, alarmCodeTitle, CHANGES } from "../../words/alarm";
import { CheckGroup } from "./check-group";
import { draftOf, firstDraft, isComplete, ruleOf, type RuleDraft } from "./rule-draft";
import { RuleFields } from "./rule-fields";

interface Props {
  /** The rule that is changed; without one, a rule is made. */
  rule?: Rule;
  channels: Channel[];
  saved: () => void;
}

export function RuleForm({ rule: before, channels, saved }: Props) {
  const [rule] = useState(before);
  const [draft, setDraft] = useState(() => (rule ? draftOf(rule) : firstDraft(channels[0]?.id ?? "")));
  const change = (part: Partial<RuleDraft>) => setDraft((before) => ({ ...before, ...part }));
  const save = async () => {
    await (rule ? alarmApi.putRule(rule, ruleOf(draft, rule)) : alarmApi.createRule(ruleOf(draft)));
    saved();
  };
  return (
    <>
      <RuleFields draft={draft} channels={channels} change={change} />
      <CheckGroup
        legend="Faults (all if none is chosen)"
        options={ALARM_CODES}
        word={alarmCodeTitle}
        chosen={draft.codes}
        change={(codes) => change({ codes })}
      />
      <CheckGroup
        legend="Notify when a fault is"
        options={Object.keys(CHANGES) as AlarmChange[]}
        word={(option) => CHANGES[option]}
        chosen={draft.changes}
        change={(changes) => change({ changes })}
      />
      <div class="form-end">
        <ActionButton class="primary" disabled={!isComplete(draft)} action={save}>
          {rule ? "Save" : "Add"}
        </ActionButton>
      </div>
    </>
  );
}
