import { useState } from "preact/hooks";
import { useDelayed } from "../../hooks/use-delayed";
import { ActorField, useActor } from "../../parts/actor-field";
import { useRefusal } from "../../parts/login/rights";
import { UndoNote } from "../../parts/undo-note";
import { plural } from "../../words/numbers";

interface Props {
  /** How many alarms are chosen that nobody has acknowledged yet. */
  open: number;
  acknowledge: () => Promise<void>;
}

/** The button that acknowledges the chosen alarms, which can be taken back for a while. */
export function AcknowledgeTools({ open, acknowledge }: Props) {
  const actor = useActor();
  const refused = useRefusal("operator");
  /** How many were chosen when the button was used: others may be chosen while it can be taken back. */
  const [asked, setAsked] = useState(0);
  const delayed = useDelayed(() => {
    actor.remember();
    return acknowledge();
  });
  return (
    <>
      <ActorField actor={actor} />
      <button
        type="button"
        class="primary"
        disabled={!open || delayed.isWaiting || refused !== undefined}
        title={refused}
        onClick={() => {
          setAsked(open);
          delayed.start();
        }}
      >
        Acknowledge {open || ""}
      </button>
      <UndoNote delayed={delayed} text={`Acknowledging ${plural(asked, "alarm")}.`} />
    </>
  );
}
