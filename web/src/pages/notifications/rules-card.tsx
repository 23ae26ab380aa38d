import { useState } from "preact/hooks";
import { alarmApi, type Channel, type NewRule, type Rule } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { Dialog } from "../../parts/dialog";
import { alarmCodeTitle, CHANGES } from "../../words/alarm";
import { dateTime, duration } from "../../words/time";
import { RuleForm } from "./rule-form";

interface Props {
  rules: Rule[];
  /** None if the caller may not change them. */
  channels?: Channel[];
  refetch: () => Promise<unknown>;
}

export function RulesCard({ rules, channels, refetch }: Props) {
  const [isOpen, setOpen] = useState(false);
  const made = () => {
    setOpen(false);
    void refetch();
  };
  return (
    <section class="card">
      <h2>Rules</h2>
      {!rules.length && <p class="quiet">No rule yet: nobody is told of anything.</p>}
      {rules.length > 0 && (
        <div class="scroll">
          <table class="list alarms">
            <thead>
              <tr>
                <th>Name</th>
                <th>Rigs</th>
                <th>Told of</th>
                <th>Channel</th>
                <th>Repeated</th>
                {channels && <th>Actions</th>}
              </tr>
            </thead>
            <tbody>
              {rules.map((rule) => (
                <RuleRow key={rule.id} rule={rule} mayChange={!!channels} refetch={refetch} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {channels && (
        <p>
          <button type="button" disabled={!channels.length} onClick={() => setOpen(true)}>
            Add a rule
          </button>
          {!channels.length && <span class="quiet"> Add a channel first.</span>}
        </p>
      )}
      {isOpen && channels && (
        <Dialog title="Add a rule" close={() => setOpen(false)}>
          <RuleForm channels={channels} made={made} />
        </Dialog>
      )}
    </section>
  );
}

/** Hours for which a rule is silenced by its button. */
const SILENCE_H = 8;

function RuleRow({
  rule,
  mayChange,
  refetch,
}: {
  rule: Rule;
  mayChange: boolean;
  refetch: () => Promise<unknown>;
}) {
  const { id, channel_name, created_at: _, ...settings } = rule;
  const isSilent = !!rule.silent_until && Date.parse(rule.silent_until) > Date.now();
  const change = (more: Partial<NewRule>) => async () => {
    await alarmApi.putRule(id, { ...settings, ...more });
    await refetch();
  };
  const silenceEnd = () => new Date(Date.now() + SILENCE_H * 3_600_000).toISOString();
  const remove = async () => {
    await alarmApi.deleteRule(id);
    await refetch();
  };
  const codes = rule.codes?.length ? rule.codes.map(alarmCodeTitle).join(", ") : "any fault";
  return (
    <tr>
      <th scope="row">
        {rule.name}
        {!rule.enabled && <span class="quiet"> (off)</span>}
        {isSilent && <p class="quiet small-text">silent until {dateTime(rule.silent_until)}</p>}
      </th>
      <td data-word="rigs">{rule.asset}</td>
      <td>
        {codes}: {(rule.changes ?? []).map((word) => CHANGES[word]).join("; ")}
      </td>
      <td data-word="by">{channel_name}</td>
      <td data-word="repeated">{rule.repeat_s ? `every ${duration(rule.repeat_s)}` : "–"}</td>
      {mayChange && (
        <td>
          <ActionButton class="small" action={change({ enabled: !rule.enabled })}>
            {rule.enabled ? "Turn off" : "Turn on"}
          </ActionButton>{" "}
          <ActionButton class="small" action={change({ silent_until: isSilent ? null : silenceEnd() })}>
            {isSilent ? "End the silence" : `Silence ${SILENCE_H} h`}
          </ActionButton>{" "}
          <ActionButton class="small" label={`Delete ${rule.name}`} action={remove}>
            Delete
          </ActionButton>
        </td>
      )}
    </tr>
  );
}
