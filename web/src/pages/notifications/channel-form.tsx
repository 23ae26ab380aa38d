import { useState } from "preact/hooks";
import { alarmApi, type NewChannel } from "../../api/alarms";
import { ActionButton } from "../../parts/action-button";

/** What the form holds, as text. */
const EMPTY = {
  kind: "webhook",
  name: "",
  url: "",
  host: "",
  port: "587",
  security: "starttls",
  user: "",
  password: "",
  from: "",
  to: "",
};

type Draft = typeof EMPTY;

function channelOf(draft: Draft): NewChannel {
  const { name, url, host, user, password, from } = draft;
  if (draft.kind === "webhook") return { name, webhook: { url } };
  const security = draft.security as "tls" | "starttls" | "none";
  const to = draft.to.split(/[\s,;]+/).filter((address) => address);
  const login = user ? { user, password } : {};
  return { name, email: { host, port: Number(draft.port), security, from, to, ...login } };
}

export function ChannelForm({ made }: { made: (secret?: string | null) => void }) {
  const [draft, setDraft] = useState(EMPTY);
  const field = (key: keyof Draft, word: string, type: "text" | "url" | "number" | "password" = "text") => (
    <label>
      {word}
      <input
        // The types of a form differ in attributes that are not used here.
        type={type as "text"}
        value={draft[key]}
        autocomplete="off"
        onInput={(e) => setDraft({ ...draft, [key]: e.currentTarget.value })}
      />
    </label>
  );
  const choice = (key: keyof Draft, word: string, options: [string, string][]) => (
    <label>
      {word}
      <select value={draft[key]} onChange={(e) => setDraft({ ...draft, [key]: e.currentTarget.value })}>
        {options.map(([value, name]) => (
          <option value={value}>{name}</option>
        ))}
      </select>
    </label>
  );
  const isComplete = draft.name.trim() && (draft.kind === "webhook" ? draft.url : draft.host && draft.to);
  const save = async () => made((await alarmApi.createChannel(channelOf(draft))).secret);
  return (
    <>
      <div class="form-row">
        {choice("kind", "Kind", [
          ["webhook", "Webhook"],
          ["email", "E-mail"],
        ])}
        {field("name", "Name")}
        {draft.kind === "webhook" && field("url", "URL", "url")}
      </div>
      {draft.kind === "webhook" && (
        <p class="quiet">
          Each message is posted as a CloudEvent (JSON). It is signed as Standard Webhooks say; the key is
          shown once.
        </p>
      )}
      {draft.kind === "email" && (
        <>
          <div class="form-row">
            {field("host", "Mail server")}
            {field("port", "Port", "number")}
            {choice("security", "Encryption", [
              ["starttls", "STARTTLS"],
              ["tls", "TLS"],
              ["none", "none"],
            ])}
          </div>
          <div class="form-row">
            {field("user", "User (if needed)")}
            {field("password", "Password", "password")}
          </div>
          <div class="form-row">
            {field("from", "From")}
            {field("to", "To (several with commas)")}
          </div>
        </>
      )}
      <div class="form-end">
        <ActionButton class="primary" disabled={!isComplete} action={save}>
          Add
        </ActionButton>
      </div>
    </>
  );
}
