import { ActionButton } from "../../parts/action-button";
import { ActorField, useActor } from "../../parts/actor-field";

interface Props {
  /** How many alarms are chosen that nobody has acknowledged yet. */
  open: number;
  acknowledge: () => Promise<void>;
}

/** The button that acknowledges the chosen alarms, and the name that is recorded with it. */
export function AcknowledgeTools({ open, acknowledge }: Props) {
  const actor = useActor();
  const acknowledgeAsActor = () => {
    actor.remember();
    return acknowledge();
  };
  return (
    <>
      <ActorField actor={actor} />
      <ActionButton class="primary" disabled={!open} action={acknowledgeAsActor} needs="operator">
        Acknowledge {open || ""}
      </ActionButton>
    </>
  );
}
