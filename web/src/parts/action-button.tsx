import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { errorText } from "../api/request";
import { useRefusal, type NeededRole } from "./login/rights";

interface Props {
  action: () => Promise<unknown>;
  children: ComponentChildren;
  class?: string;
  disabled?: boolean;
  /** What a screen reader says instead of the text. */
  label?: string;
  /** The role that the action needs: for others the button is disabled and says so. */
  needs?: NeededRole;
}

/** A button that is disabled while its action runs and shows the error of the action. */
export function ActionButton({ action, children, class: className, disabled, label, needs }: Props) {
  const [isBusy, setBusy] = useState(false);
  const [error, setError] = useState<unknown>();
  const refused = useRefusal(needs);
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
        disabled={isBusy || disabled || refused !== undefined}
        title={refused}
        aria-label={label}
        aria-busy={isBusy}
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
