import { useState } from "preact/hooks";
import { alarmApi, type Channel } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";
import { Choice } from "../../parts/choice";
import { useFeature } from "../../parts/service-health";
import { channelOf, draftOf, EMPTY_DRAFT, FORMATS, isComplete, type ChannelDraft } from "./channel-draft";
import { ChannelField } from "./channel-field";
import { EmailFields } from "./email-fields";

/** The kinds of channels; a build without e-mail says so before its form is filled in. */
const kinds = (hasEmail: boolean) =>
  [
    ["webhook", "Webhook"],
    ["email", hasEmail ? "E-mail" : "E-mail (not in this build)"],
  ] as const;

interface Props {
  /** The channel to change; a new one without it. */
  channel?: Channel;
  /** Called with the key of the signature if there is a new one. */
  made: (secret?: string | null) => void;
}

/** Makes or changes a channel. */
export function ChannelForm({ channel: before, made }: Props) {
  const [channel] = useState(before);
  const [draft, setDraft] = useState(channel ? draftOf(channel) : EMPTY_DRAFT);
  const { kind, name, url, format } = draft;
  const hasEmail = useFeature()("email");
  const isMissing = kind === "email" && !hasEmail;
  const change = (part: Partial<ChannelDraft>) => setDraft((before) => ({ ...before, ...part }));
  const save = async () => {
    const settings = channelOf(draft);
    const saved = channel ? alarmApi.putChannel(channel, settings) : alarmApi.createChannel(settings);
    made((await saved).secret);
  };
  return (
    <>
      <div class="form-row">
        {!channel && (
          <Choice label="Kind" value={kind} options={kinds(hasEmail)} change={(kind) => change({ kind })} />
        )}
        <ChannelField word="Name" value={name} change={(name) => change({ name })} />
        {kind === "webhook" && (
          <>
            <ChannelField word="URL" type="url" value={url} change={(url) => change({ url })} />
            <Choice label="Format" value={format} options={FORMATS} change={(format) => change({ format })} />
          </>
        )}
      </div>
      {kind === "webhook" && (
        <p class="quiet">
          Each message is signed per Standard Webhooks; the signing key{" "}
          {channel ? "stays as it is." : "is shown once."}
        </p>
      )}
      {isMissing && (
        <p class="note" role="status">
          This service is built without e-mail. Use a webhook, or ask for a build with the feature “email”.
        </p>
      )}
      {kind === "email" && hasEmail && (
        <EmailFields draft={draft} hasPassword={channel?.email?.has_password} change={change} />
      )}
      <div class="form-end">
        <ActionButton class="primary" disabled={isMissing || !isComplete(draft)} action={save}>
          {channel ? "Save" : "Add"}
        </ActionButton>
      </div>
    </>
  );
}
