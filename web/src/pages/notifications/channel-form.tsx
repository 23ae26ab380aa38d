import { useState } from "preact/hooks";
import { alarmApi } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { Choice } from "../../parts/choice";
import { channelOf, EMPTY_DRAFT, isComplete, type ChannelDraft } from "./channel-draft";
import { ChannelField } from "./channel-field";
import { EmailFields } from "./email-fields";

const KINDS = [
  ["webhook", "Webhook"],
  ["email", "E-mail"],
] as const;

export function ChannelForm({ made }: { made: (secret?: string | null) => void }) {
  const [draft, setDraft] = useState(EMPTY_DRAFT);
  const { kind, name, url } = draft;
  const change = (part: Partial<ChannelDraft>) => setDraft((before) => ({ ...before, ...part }));
  const save = async () => made((await alarmApi.createChannel(channelOf(draft))).secret);
  return (
    <>
      <div class="form-row">
        <Choice label="Kind" value={kind} options={KINDS} change={(kind) => change({ kind })} />
        <ChannelField word="Name" value={name} change={(name) => change({ name })} />
        {kind === "webhook" && (
          <ChannelField word="URL" type="url" value={url} change={(url) => change({ url })} />
        )}
      </div>
      {kind === "webhook" && (
        <p class="quiet">
          Each message is posted as a CloudEvent (JSON). It is signed as Standard Webhooks say; the key is
          shown once.
        </p>
      )}
      {kind === "email" && <EmailFields draft={draft} change={change} />}
      <div class="form-end">
        <ActionButton class="primary" disabled={!isComplete(draft)} action={save}>
          Add
        </ActionButton>
      </div>
    </>
  );
}
