import type { Channel, NewChannel } from "../../api/alarms";

type WebhookFormat = NonNullable<Channel["format"]>;

/** What a webhook can post. */
export const FORMATS: [WebhookFormat, string][] = [
  ["cloudevents", "CloudEvent (JSON, for programs)"],
  ["slack", "Slack, Mattermost"],
  ["teams", "Microsoft Teams"],
  ["text", "Plain text"],
];

/** What the form of a channel holds at first, as text. */
export const EMPTY_DRAFT = {
  kind: "webhook",
  name: "",
  url: "",
  format: "cloudevents" as WebhookFormat,
  host: "",
  port: "587",
  security: "starttls",
  user: "",
  password: "",
  from: "",
  to: "",
};

export type ChannelDraft = typeof EMPTY_DRAFT;

/** What the form of `channel` holds. Its password and its key are told to nobody. */
export function draftOf({ kind, name, url, format, email }: Channel): ChannelDraft {
  if (!email) return { ...EMPTY_DRAFT, kind, name, url: url ?? "", format: format ?? EMPTY_DRAFT.format };
  const { host, port, security, user, from, to } = email;
  const text = { port: String(port), user: user ?? "", to: to.join(", ") };
  return { ...EMPTY_DRAFT, kind, name, host, security, from, ...text };
}

/** The channel that the form describes. Without a password, that of the channel before stays. */
export function channelOf(draft: ChannelDraft): NewChannel {
  const { name, url, format, host, user, password, from } = draft;
  if (draft.kind === "webhook") return { name, webhook: { url, format } };
  const security = draft.security as "tls" | "starttls" | "none";
  const to = draft.to.split(/[\s,;]+/).filter((address) => address);
  const login = user ? { user, ...(password && { password }) } : {};
  return { name, email: { host, port: Number(draft.port), security, from, to, ...login } };
}

/** Whether the form holds all that a channel needs. */
export function isComplete({ kind, name, url, host, to }: ChannelDraft): boolean {
  return !!(name.trim() && (kind === "webhook" ? url : host && to));
}
