import { useState } from "preact/hooks";
import { actor, rememberActor } from "../../api/access";
import { api } from "../../api/client";
import type { FaultCode, FaultEntry } from "../../api/types";
import { ActionButton } from "../../parts/action-button";

/** The actions on the fault, and the name that is recorded with them. */
export function FaultActions({ fault, refetch }: { fault: FaultEntry; refetch: () => Promise<unknown> }) {
  const { asset, code, acknowledged } = fault;
  const [name, setName] = useState(actor());
  const asActor = (action: (asset: string, code: FaultCode) => Promise<unknown>) => async () => {
    rememberActor(name);
    await action(asset, code);
    await refetch();
  };
  return (
    <div class="page-tools">
      <label class="inline">
        as{" "}
        <input
          value={name}
          size={12}
          maxLength={60}
          onInput={(e) => setName(e.currentTarget.value)}
          aria-label="Your name, recorded with the action"
        />
      </label>
      <ActionButton class="primary" disabled={acknowledged} action={asActor(api.acknowledge)}>
        {acknowledged ? "Acknowledged" : "Acknowledge"}
      </ActionButton>
      <ActionButton action={asActor(api.clear)}>Clear</ActionButton>
    </div>
  );
}
