import { api } from "../../api/client";
import type { FaultCode, FaultEntry } from "../../api/types";
import { useDelayed } from "../../hooks/use-delayed";
import { ActorField, useActor } from "../../parts/actor-field";
import { ConfirmButton } from "../../parts/confirm-button";
import { useRefusal } from "../../parts/login/rights";
import { UndoNote } from "../../parts/undo-note";
import { codeTitle } from "../../words/fault-names";

/** The actions on the fault, and the name that is recorded with them. */
export function FaultActions({ fault, refetch }: { fault: FaultEntry; refetch: () => Promise<unknown> }) {
  const { asset, code, acknowledged } = fault;
  const actor = useActor();
  const refused = useRefusal("operator");
  const asActor = (action: (asset: string, code: FaultCode) => Promise<unknown>) => async () => {
    actor.remember();
    await action(asset, code);
    await refetch();
  };
  const acknowledging = useDelayed(asActor(api.acknowledge));
  const clearing = useDelayed(asActor(api.clear));
  const isBusy = acknowledging.isWaiting || clearing.isWaiting;
  return (
    <div class="page-tools">
      <ActorField actor={actor} />
      <UndoNote delayed={acknowledging} text="Acknowledging." />
      <UndoNote delayed={clearing} text="Clearing." />
      <button
        type="button"
        class="primary"
        disabled={acknowledged || isBusy || refused !== undefined}
        title={refused}
        onClick={acknowledging.start}
      >
        {acknowledged ? "Acknowledged" : "Acknowledge"}
      </button>
      <ConfirmButton
        word="Clear"
        question={`Clear the record of ${codeTitle(code)}?`}
        action={() => Promise.resolve(clearing.start())}
        needs="operator"
      >
        This erases the fault from the memory of {asset}: its status, its occurrences and its freeze frame.
        The history and the recordings stay. Clear it after the repair; if the fault is still there, it will
        be found again.
      </ConfirmButton>
    </div>
  );
}
