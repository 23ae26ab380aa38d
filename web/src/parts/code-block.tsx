import { useState } from "preact/hooks";

/** Duration of the confirmation on the button, ms. */
const COPIED_MS = 2000;

/** A text with a button that copies it. */
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
