import { useState } from "preact/hooks";
import { administration, type Role } from "../../api/administration";
import type { NewToken } from "../../api/types";
import { useNow } from "../../hooks/use-now";
import { useRigNames } from "../../hooks/use-rig-names";
import { ActionButton } from "../../parts/action-button";
import { Choice } from "../../parts/choice";
import { EMPTY_DRAFT, obstacle, tokenOf, type TokenDraft } from "./token-draft";
import { ROLES } from "./token-state";

const OPTIONS = (Object.keys(ROLES) as Role[]).map((role) => [role, `${role}: ${ROLES[role]}`] as const);

function RigField({ asset, change }: { asset: string; change: (name: string) => void }) {
  const names = useRigNames();
  return (
    <>
      <label>
        Rig
        <input list="token-rigs" value={asset} onInput={(e) => change(e.currentTarget.value)} />
      </label>
      <datalist id="token-rigs">
        {names.map((name) => (
          <option value={name} />
        ))}
      </datalist>
    </>
  );
}

/** Creates a token. */
export function TokenForm({ made }: { made: (token: NewToken) => void }) {
  const [draft, setDraft] = useState(EMPTY_DRAFT);
  const problem = obstacle(draft, useNow());
  const { name, role, asset, expires } = draft;
  const set = (part: Partial<TokenDraft>) => setDraft((before) => ({ ...before, ...part }));
  return (
    <>
      <div class="form-row">
        <label>
          Name
          <input value={name} maxLength={100} onInput={(e) => set({ name: e.currentTarget.value })} />
        </label>
        <Choice label="Role" value={role} options={OPTIONS} change={(role) => set({ role })} />
        {role === "device" && <RigField asset={asset} change={(asset) => set({ asset })} />}
        <label>
          Expires (empty: never)
          <input
            type="datetime-local"
            value={expires}
            onInput={(e) => set({ expires: e.currentTarget.value })}
          />
        </label>
      </div>
      <p class="quiet">
        The name of the token is recorded with every action of its holder: one token for each person and
        device.
      </p>
      <div class="form-end">
        <span class="quiet" role="status">
          {problem}
        </span>
        <ActionButton
          class="primary"
          disabled={problem !== ""}
          action={async () => made(await administration.createToken(tokenOf(draft)))}
        >
          Create
        </ActionButton>
      </div>
    </>
  );
}
