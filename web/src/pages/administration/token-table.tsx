import { useState } from "preact/hooks";
import type { Token } from "../../api/administration";
import { useNow } from "../../hooks/use-now";
import { useCaller } from "../../parts/login/caller";
import { isInForce } from "./token-state";
import { TokenRow } from "./token-row";

interface Props {
  tokens: Token[];
  changed: () => Promise<unknown>;
}

export function TokenTable({ tokens, changed }: Props) {
  const [withOld, setWithOld] = useState(false);
  const now = useNow();
  const caller = useCaller();
  const valid = tokens.filter((token) => isInForce(token, now));
  const shown = withOld ? tokens : valid;
  const isOwn = (token: Token) => token.name === caller?.name && isInForce(token, now);
  return (
    <>
      {!shown.length && <p class="quiet">No valid token.</p>}
      {shown.length > 0 && (
        <div class="scroll">
          <table class="list alarms">
            <thead>
              <tr>
                <th>Name</th>
                <th>Role</th>
                <th>State</th>
                <th>Last used</th>
                <th>Created</th>
                <th>
                  <span class="hidden">Actions</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {shown.map((token) => (
                <TokenRow key={token.id} token={token} now={now} isOwn={isOwn(token)} changed={changed} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {valid.length < tokens.length && (
        <p>
          <label class="check">
            <input type="checkbox" checked={withOld} onChange={(e) => setWithOld(e.currentTarget.checked)} />
            Also those that are revoked or have expired
          </label>
        </p>
      )}
    </>
  );
}
