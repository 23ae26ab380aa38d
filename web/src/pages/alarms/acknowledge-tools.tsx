import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";
import { ConfirmButton } from "../../parts/confirm-button";

interface Props {
  /** How many alarms are chosen that nobody has acknowledged yet. */
  open: number;
  acknowledge: () => Promise<void>;
}

/** The button that acknowledges the chosen alarms, several of them after a question. */
export function AcknowledgeTools({ open, acknowledge }: Props) {
  const actor = useActor();
  const acknowledgeAsActor = () => {
    actor.remember();
    return acknowledge();
  };
  return (
    <>
      <ActorField actor={actor} />
      {open > 1 ? (
        <ConfirmButton
          class="primary"
          word={`Acknowledge ${open}`}
          question={`Acknowledge ${open} alarms?`}
          action={acknowledgeAsActor}
          needs="operator"
        >
          It is recorded that you have seen them, and they are no longer repeated to anybody. This cannot be
          taken back; a fault that occurs again is unacknowledged.
        </ConfirmButton>
      ) : (
        <ActionButton class="primary" disabled={!open} action={acknowledgeAsActor} needs="operator">
          Acknowledge {open || ""}
        </ActionButton>
      )}
    </>
  );
}
