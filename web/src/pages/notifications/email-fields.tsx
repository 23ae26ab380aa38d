import { Choice } from "../../parts/choice";
import type { ChannelDraft } from "./channel-draft";
import { ChannelField } from "./channel-field";

const ENCRYPTIONS = [
  ["starttls", "STARTTLS"],
  ["tls", "TLS"],
  ["none", "none"],
] as const;

interface Props {
  draft: ChannelDraft;
  /** Whether the channel has a password, which stays if none is given. */
  hasPassword?: boolean;
  change: (part: Partial<ChannelDraft>) => void;
}

/** The fields of a channel that sends e-mail. */
export function EmailFields({ draft, hasPassword, change }: Props) {
  const { host, port, security, user, password, from, to } = draft;
  return (
    <>
      <div class="form-row">
        <ChannelField word="Mail server" value={host} change={(host) => change({ host })} />
        <ChannelField word="Port" type="number" value={port} change={(port) => change({ port })} />
        <Choice
          label="Encryption"
          value={security}
          options={ENCRYPTIONS}
          change={(security) => change({ security })}
        />
      </div>
      <div class="form-row">
        <ChannelField word="User (if needed)" value={user} change={(user) => change({ user })} />
        <ChannelField
          word={hasPassword ? "New password (if it changes)" : "Password"}
          type="password"
          value={password}
          change={(password) => change({ password })}
        />
      </div>
      <div class="form-row">
        <ChannelField word="From" value={from} change={(from) => change({ from })} />
        <ChannelField word="To (several with commas)" value={to} change={(to) => change({ to })} />
      </div>
    </>
  );
}
