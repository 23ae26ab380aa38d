import { alarmApi, type NewRule, type Rule } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { alarmCodeTitle, CHANGES } from "../../words/alarm";
import { dateTime, duration } from "../../words/time";

/** Hours for which a rule is silenced by its button. */
const SILENCE_H = 8;

/** The settings of a rule: every one, so that a change of one keeps the others. */
function settingsOf(rule: Rule): { [Key in keyof Required<NewRule>]: NewRule[Key] } {
  const { name, asset, tag, channel, codes, changes, enabled, repeat_s, silent_until } = rule;
  return { name, asset, tag, channel, codes, changes, enabled, repeat_s, silent_until };
}

interface Props {
  rule: Rule;
  mayChange: boolean;
  refetch: () => Promise<unknown>;
}

export function RuleRow({ rule, mayChange, refetch }: Props) {
  const isSilent = !!rule.silent_until && Date.parse(rule.silent_until) > Date.now();
  const change = (more: Partial<NewRule>) => async () => {
    await alarmApi.putRule(rule.id, { ...settingsOf(rule), ...more });
    await refetch();
  };
  const silenceEnd = () => new Date(Date.now() + SILENCE_H * 3_600_000).toISOString();
  const remove = async () => {
    await alarmApi.deleteRule(rule.id);
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
      <td data-word="rigs">
        {rule.asset === "*" ? "all" : rule.asset}
        {rule.tag && <span class="quiet"> with {rule.tag}</span>}
      </td>
      <td>
        {codes}: {(rule.changes ?? []).map((word) => CHANGES[word]).join("; ")}
      </td>
      <td data-word="by">{rule.channel_name}</td>
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
