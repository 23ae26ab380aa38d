import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { errorText } from "../api/request";

interface Props {
  action: () => Promise<unknown>;
  children: ComponentChildren;
  class?: string;
  disabled?: boolean;
  /** The accessible name, where the text alone does not say enough. */
  label?: string;
}

/** A button that waits for its action to end, and says what went wrong. */
export function ActionButton({ action, children, class: className, disabled, label }: Props) {
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<unknown>();
  const isMounted = useRef(true);
  useEffect(() => () => void (isMounted.current = false), []);
  const run = async () => {
    setBusy(true);
    setError(undefined);
    try {
      await action();
    } catch (thrown) {
      if (isMounted.current) setError(thrown);
    }
    if (isMounted.current) setBusy(false);
  };
  return (
    <>
      <button
        type="button"
        class={className}
        disabled={isBusy || disabled}
        aria-busy={isBusy}
        aria-label={label}
        onClick={run}
      >
        {children}
      </button>
      {error !== undefined && (
        <span class="trouble-inline" role="alert">
          {errorText(error)}
        </span>
      )}
    </>
  );
}
