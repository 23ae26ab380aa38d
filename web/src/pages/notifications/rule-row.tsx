import { alarmApi, type Channel, type NewRule, type Rule } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { ConfirmButton } from "../../parts/confirm-button";
import { alarmCodeTitle, CHANGES } from "../../words/alarm";
import { dateTime, duration } from "../../words/time";
import { EditRule } from "./edit-rule";

/** Hours for which a rule is muted by its button. */
const MUTE_H = 8;

/** The settings of a rule: every one, so that a change of one keeps the others. */
function settingsOf(rule: Rule): { [Key in keyof Required<NewRule>]: NewRule[Key] } {
  const { name, asset, tag, channel, codes, changes, enabled } = rule;
  const { delay_s, repeat_s, silent_until, quiet_hours } = rule;
  return { name, asset, tag, channel, codes, changes, enabled, delay_s, repeat_s, silent_until, quiet_hours };
}

const isSilent = ({ silent_until }: Rule) => !!silent_until && Date.parse(silent_until) > Date.now();

interface Props {
  rule: Rule;
  /** None if the caller may not change them. */
  channels?: Channel[];
  refetch: () => Promise<unknown>;
}

export function RuleRow({ rule, channels, refetch }: Props) {
  const quiet = rule.quiet_hours;
  const codes = rule.codes?.length ? rule.codes.map(alarmCodeTitle).join(", ") : "any fault";
  return (
    <tr>
      <th scope="row">
        {rule.name}
        {!rule.enabled && <span class="quiet"> (off)</span>}
        {isSilent(rule) && <p class="quiet small-text">muted until {dateTime(rule.silent_until)}</p>}
      </th>
      <td data-word="rigs">
        {rule.asset === "*" ? "all" : rule.asset}
        {rule.tag && <span class="quiet"> with {rule.tag}</span>}
      </td>
      <td>
        {codes}: {(rule.changes ?? []).map((word) => CHANGES[word]).join("; ")}
        {!!rule.delay_s && <span class="quiet"> if it still fails after {duration(rule.delay_s)}</span>}
        {quiet && (
          <span class="quiet">
            , not from {quiet.from} to {quiet.to} ({quiet.time_zone})
          </span>
        )}
      </td>
      <td data-word="by">{rule.channel_name}</td>
      <td data-word="repeated">{rule.repeat_s ? `every ${duration(rule.repeat_s)}` : "–"}</td>
      {channels && (
        <td>
          <RuleActions rule={rule} channels={channels} refetch={refetch} />
        </td>
      )}
    </tr>
  );
}

function RuleActions({ rule, channels, refetch }: Required<Props>) {
  const isMuted = isSilent(rule);
  const muteEnd = () => new Date(Date.now() + MUTE_H * 3_600_000).toISOString();
  const change = (more: Partial<NewRule>) => async () => {
    await alarmApi.putRule(rule, { ...settingsOf(rule), ...more });
    await refetch();
  };
  const remove = async () => {
    await alarmApi.deleteRule(rule);
    await refetch();
  };
  return (
    <>
      <EditRule rule={rule} channels={channels} refetch={refetch} />{" "}
      <ActionButton class="small" action={change({ enabled: !rule.enabled })}>
        {rule.enabled ? "Turn off" : "Turn on"}
      </ActionButton>{" "}
      <ActionButton class="small" action={change({ silent_until: isMuted ? null : muteEnd() })}>
        {isMuted ? "Unmute" : `Mute ${MUTE_H} h`}
      </ActionButton>{" "}
      <ConfirmButton
        class="small"
        word="Delete"
        label={`Delete ${rule.name}`}
        question={`Delete the rule ${rule.name}?`}
        action={remove}
      >
        No notifications are sent any more of what only this rule selects. To pause it, mute it or turn it off
        instead.
      </ConfirmButton>
    </>
  );
}
