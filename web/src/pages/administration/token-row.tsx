import { administration, type Token } from "../../api/administration";
import { ConfirmButton } from "../../parts/confirm-button";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { dateTime, timeAgo } from "../../words/time";
import { isInForce, tokenState } from "./token-state";

interface Props {
  token: Token;
  now: number;
  /** Whether the user of the page is logged in with it. */
  isOwn: boolean;
  changed: () => Promise<unknown>;
}

export function TokenRow({ token, now, isOwn, changed }: Props) {
  const { id, name, role, asset, created_at, created_by, last_used_at } = token;
  const inForce = isInForce(token, now);
  const revoke = () => administration.revokeToken(id).then(changed);
  return (
    <tr class={inForce ? undefined : "quiet"}>
      <th scope="row">{name}</th>
      <td>
        {role}
        {asset && (
          <>
            {" of "}
            <Link to={rigPath(asset)}>{asset}</Link>
          </>
        )}
      </td>
      <td>{tokenState(token, now)}</td>
      <td data-word="last used" title={last_used_at ? `${dateTime(last_used_at)}, to the hour` : undefined}>
        {timeAgo(last_used_at, now)}
      </td>
      <td data-word="created">
        {dateTime(created_at)} by {created_by}
      </td>
      <td>
        {inForce && (
          <ConfirmButton
            class="small"
            word="Revoke"
            label={`Revoke ${name}`}
            question={`Revoke the token ${name}?`}
            action={revoke}
          >
            Its holder is logged out and refused at once, and its streams end. This cannot be undone.
            {isOwn && " You are logged in with this token yourself: you will be logged out."}
          </ConfirmButton>
        )}
      </td>
    </tr>
  );
}
