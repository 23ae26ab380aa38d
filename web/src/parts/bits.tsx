/** Small pieces that many views use. */
import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { words as problemWords } from "../api/client";
import { faultTitle, severity } from "../words";

export type Health = "fault" | "suspect" | "drift" | "ok" | "silent" | "idle";

const HEALTH: Record<Health, { sign: string; word: string }> = {
  fault: { sign: "▲", word: "fault" },
  suspect: { sign: "◆", word: "suspected" },
  drift: { sign: "◇", word: "drifting" },
  ok: { sign: "●", word: "no fault" },
  silent: { sign: "○", word: "silent" },
  idle: { sign: "○", word: "no session" },
};

/** Colour, shape and word together: none of them alone carries the meaning. */
export function HealthMark({ health, word = true }: { health: Health; word?: boolean }) {
  const { sign, word: text } = HEALTH[health];
  return (
    <span class={`health health-${health}`}>
      <span aria-hidden="true">{sign}</span>
      {word ? <span>{text}</span> : <span class="hidden">{text}</span>}
    </span>
  );
}

type Standing = { status: string; acknowledged?: boolean };

const level = (fault: Standing) => ["none", "pending", "known", "confirmed"][severity(fault)];
const standing = ({ status, acknowledged }: Standing) =>
  acknowledged && status !== "cleared" ? `${status}, acknowledged` : status;

export function StatusChip(fault: Standing) {
  return (
    <span class={`chip chip-${level(fault)}`}>
      <b>{standing(fault)}</b>
    </span>
  );
}

export function FaultChip({ code, kind, ...fault }: Standing & { code: string; kind?: string | null }) {
  return (
    <span class={`chip chip-${level(fault)}`}>
      <b>{faultTitle(code, kind)}</b> <span>{standing(fault)}</span>
    </span>
  );
}

export function Trouble({ error, again }: { error: unknown; again?: () => void }) {
  if (!error) return null;
  return (
    <p class="trouble" role="alert">
      <span>{problemWords(error)}</span>
      {again && (
        <button type="button" onClick={again}>
          Try again
        </button>
      )}
    </p>
  );
}

export function Loading({ what }: { what: string }) {
  return (
    <p class="quiet loading" role="status">
      Loading {what}…
    </p>
  );
}

export function Empty({ title, children }: { title: string; children?: ComponentChildren }) {
  return (
    <div class="empty">
      <h2>{title}</h2>
      {children}
    </div>
  );
}

/** A button that waits for what it does, and says what went wrong. */
export function Act({
  act,
  children,
  class: name,
  disabled,
  label,
}: {
  act: () => Promise<unknown>;
  children: ComponentChildren;
  class?: string;
  disabled?: boolean;
  label?: string;
}) {
  const [busy, setBusy] = useState(false);
  const [error, setError] = useState<unknown>();
  const alive = useRef(true);
  useEffect(() => () => void (alive.current = false), []);
  const run = async () => {
    setBusy(true);
    setError(undefined);
    try {
      await act();
    } catch (wrong) {
      if (alive.current) setError(wrong);
    }
    if (alive.current) setBusy(false);
  };
  return (
    <>
      <button
        type="button"
        class={name}
        disabled={busy || disabled}
        aria-busy={busy}
        aria-label={label}
        onClick={run}
      >
        {children}
      </button>
      {error !== undefined && (
        <span class="trouble-inline" role="alert">
          {problemWords(error)}
        </span>
      )}
    </>
  );
}

/** A dialogue of the browser's own: it keeps the focus and closes on Escape. */
export function Dialogue({
  title,
  close,
  children,
}: {
  title: string;
  close: () => void;
  children: ComponentChildren;
}) {
  const element = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    element.current!.showModal();
  }, []);
  return (
    <dialog ref={element} aria-label={title} onClose={close}>
      <header>
        <h2>{title}</h2>
        <button type="button" class="small" onClick={() => element.current!.close()} aria-label="Close">
          ✕
        </button>
      </header>
      {children}
    </dialog>
  );
}

export function Code({ children, label }: { children: string; label: string }) {
  const [copied, setCopied] = useState(false);
  const copy = async () => {
    await navigator.clipboard.writeText(children);
    setCopied(true);
    setTimeout(() => setCopied(false), 2000);
  };
  return (
    <div class="code">
      <button type="button" class="small" onClick={() => void copy()}>
        {copied ? "copied" : "copy"}
      </button>
      <pre tabIndex={0} role="region" aria-label={label}>
        <code>{children}</code>
      </pre>
    </div>
  );
}

/** A definition list in columns: a name and its value. */
export function Facts({ of }: { of: [string, ComponentChildren][] }) {
  return (
    <dl class="facts">
      {of.map(([name, value]) => (
        <div>
          <dt>{name}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}
