import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { ActionButton } from "./action-button";
import { Dialog } from "./dialog";
import { useRefusal, type NeededRole } from "./login/rights";

interface Props {
  /** The text of the button, and of the one that confirms. */
  word: string;
  /** The question, as the title of the dialog. */
  question: string;
  action: () => Promise<unknown>;
  class?: string;
  /** What a screen reader says instead of the text of the button. */
  label?: string;
  needs?: NeededRole;
  /** What will happen. */
  children: ComponentChildren;
}

/** A button whose action is carried out after a question. */
export function ConfirmButton({ word, question, action, needs, class: className, label, children }: Props) {
  const [isAsking, setAsking] = useState(false);
  const refused = useRefusal(needs);
  const confirmed = () => action().then(() => setAsking(false));
  return (
    <>
      <button
        type="button"
        class={className}
        disabled={refused !== undefined}
        title={refused}
        aria-label={label}
        onClick={() => setAsking(true)}
      >
        {word}
      </button>
      {isAsking && (
        <Dialog title={question} close={() => setAsking(false)}>
          <p>{children}</p>
          <div class="form-end">
            <button type="button" onClick={() => setAsking(false)}>
              Cancel
            </button>
            <ActionButton class="danger" action={confirmed}>
              {word}
            </ActionButton>
          </div>
        </Dialog>
      )}
    </>
  );
}
