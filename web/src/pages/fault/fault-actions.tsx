import { api } from "../../api/client";
import type { FaultCode, FaultEntry } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";
import { ConfirmButton } from "../../parts/confirm-button";
import { codeTitle } from "../../words/fault-names";

/** The actions on the fault, and the name that is recorded with them. */
export function FaultActions({ fault, refetch }: { fault: FaultEntry; refetch: () => Promise<unknown> }) {
  const { asset, code, acknowledged } = fault;
  const actor = useActor();
  const asActor = (action: (asset: string, code: FaultCode) => Promise<unknown>) => async () => {
    actor.remember();
    await action(asset, code);
    await refetch();
  };
  return (
    <div class="page-tools">
      <ActorField actor={actor} />
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
