import { useState } from "preact/hooks";

/** How long the button says that the text was copied, ms. */
const COPIED_MS = 2000;

/** A text to be copied, with the button that does it. */
export function CodeBlock({ children, label }: { children: string; label: string }) {
  const [isCopied, setCopied] = useState(false);
  const copy = async () => {
    await navigator.clipboard.writeText(children);
    setCopied(true);
    setTimeout(() => setCopied(false), COPIED_MS);
  };
  return (
    <div class="code">
      <button type="button" class="small" onClick={copy}>
        {isCopied ? "copied" : "copy"}
      </button>
      <pre tabIndex={0} role="region" aria-label={label}>
        <code>{children}</code>
      </pre>
    </div>
  );
}
