import { useState } from "preact/hooks";
import type { TargetedEvent } from "preact";

type Field = HTMLInputElement | HTMLTextAreaElement;
type Typed = TargetedEvent<Field>;

/**
 * The properties of a field whose text counts when it is finished: with Enter, or when the field is left. Without
 * them, whatever redraws the field would erase what is typed meanwhile.
 */
export function useDraft(value: string, finish: (text: string) => void) {
  const [draft, setDraft] = useState<string>();
  return {
    value: draft ?? value,
    onInput: (e: Typed) => setDraft(e.currentTarget.value),
    onChange: (e: Typed) => {
      setDraft(undefined);
      finish(e.currentTarget.value);
    },
    // If what was typed is undone, the browser reports no change.
    onBlur: () => setDraft(undefined),
  };
}
