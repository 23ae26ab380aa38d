import { useEffect, useRef } from "preact/hooks";
import type { NewToken } from "../../api/types";
import { CodeBlock } from "../../parts/code-block";

/** The secret of a new token, which the service returns only once. */
export function MadeToken({ token: { name, secret }, close }: { token: NewToken; close: () => void }) {
  const element = useRef<HTMLDivElement>(null);
  useEffect(() => element.current!.scrollIntoView({ block: "center" }), []);
  return (
    <div class="note" role="status" ref={element}>
      <p>
        The token <b>{name}</b>. Copy it now: it is shown only once.
      </p>
      <CodeBlock label={`Secret of ${name}`}>{secret}</CodeBlock>
      <button type="button" onClick={close}>
        I have copied it
      </button>
    </div>
  );
}
