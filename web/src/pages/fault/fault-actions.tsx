import { useState } from "preact/hooks";
import { actor, rememberActor } from "../../api/access";
import { api } from "../../api/client";
import type { FaultCode, FaultEntry } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { ConfirmButton } from "../../parts/confirm-button";
import { useCaller } from "../../parts/login/caller";
import { codeTitle } from "../../words/fault-names";

/** The actions on the fault, and the name that is recorded with them. */
export function FaultActions({ fault, refetch }: { fault: FaultEntry; refetch: () => Promise<unknown> }) {
  const { asset, code, acknowledged } = fault;
  const caller = useCaller();
  const [name, setName] = useState(actor());
  const asActor = (action: (asset: string, code: FaultCode) => Promise<unknown>) => async () => {
    rememberActor(name);
    await action(asset, code);
    await refetch();
  };
  return (
    <div class="page-tools">
      {!caller?.name && (
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
      )}
      <ActionButton
        class="primary"
        disabled={acknowledged}
        action={asActor(api.acknowledge)}
        needs="operator"
      >
        {acknowledged ? "Acknowledged" : "Acknowledge"}
      </ActionButton>
      <ConfirmButton
        word="Clear"
        question={`Clear the record of ${codeTitle(code)}?`}
        action={asActor(api.clear)}
        needs="operator"
      >
        This erases the fault from the memory of {asset}: its status, its occurrences and its freeze frame.
        The history and the recordings stay. Clear it after the repair; if the fault is still there, it will
        be found again.
      </ConfirmButton>
    </div>
  );
}
