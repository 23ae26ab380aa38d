import { useState } from "preact/hooks";
import { alarmApi, type AlarmChange, type Channel } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ALARM_CODES, alarmCodeTitle, CHANGES } from "../../words/alarm";
import { CheckGroup } from "./check-group";
import { firstDraft, ruleOf, type RuleDraft } from "./rule-draft";
import { RuleFields } from "./rule-fields";

export function RuleForm({ channels, made }: { channels: Channel[]; made: () => void }) {
  const [draft, setDraft] = useState(() => firstDraft(channels[0]?.id ?? ""));
  const change = (part: Partial<RuleDraft>) => setDraft((before) => ({ ...before, ...part }));
  const save = async () => {
    await alarmApi.createRule(ruleOf(draft));
    made();
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
        <ActionButton class="primary" disabled={!draft.name.trim() || !draft.changes.length} action={save}>
          Add
        </ActionButton>
      </div>
    </>
  );
}
