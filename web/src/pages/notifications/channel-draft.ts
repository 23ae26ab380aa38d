import type { NewChannel } from "../../api/alarms";

/** What the form of a channel holds at first, as text. */
export const EMPTY_DRAFT = {
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

export type ChannelDraft = typeof EMPTY_DRAFT;

/** The channel that the form describes. */
export function channelOf(draft: ChannelDraft): NewChannel {
  const { name, url, host, user, password, from } = draft;
  if (draft.kind === "webhook") return { name, webhook: { url } };
  const security = draft.security as "tls" | "starttls" | "none";
  const to = draft.to.split(/[\s,;]+/).filter((address) => address);
  const login = user ? { user, password } : {};
  return { name, email: { host, port: Number(draft.port), security, from, to, ...login } };
}

/** Whether the form holds all that a channel needs. */
export function isComplete({ kind, name, url, host, to }: ChannelDraft): boolean {
  return !!(name.trim() && (kind === "webhook" ? url : host && to));
}
