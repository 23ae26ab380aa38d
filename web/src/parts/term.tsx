import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef, useState } from "preact/hooks";
import { GLOSSARY, type GlossaryTerm } from "../words/glossary";

/** Distance of an explanation from the edges of the window, px, and its greatest width. */
const MARGIN_PX = 8;
const WIDTH_PX = 288;

/** The place of an explanation: above or below its term, where there is more room in the window. */
function placeBeside(term: HTMLElement) {
  const { left, top, bottom } = term.getBoundingClientRect();
  const width = Math.min(WIDTH_PX, innerWidth - 2 * MARGIN_PX);
  const above = top + bottom > innerHeight;
  return {
    ...(above ? { bottom: `${innerHeight - top}px` } : { top: `${bottom}px` }),
    left: `${Math.max(MARGIN_PX, Math.min(left, innerWidth - MARGIN_PX - width))}px`,
    width: `${width}px`,
  };
}

/** Shows an explanation above all else: no part of the page cuts or moves it. */
const show = (explanation: HTMLElement | null) => explanation?.showPopover();

/** A term that is explained under the pointer, with the keyboard focus, and on a tap; Escape closes it. */
export function Term({ of, children }: { of: GlossaryTerm; children: ComponentChildren }) {
  const id = useId();
  const button = useRef<HTMLButtonElement>(null);
  const [place, setPlace] = useState<ReturnType<typeof placeBeside>>();
  const open = () => setPlace(placeBeside(button.current!));
  const close = () => setPlace(undefined);
  const isOpen = place !== undefined;
  useEffect(() => {
    if (!isOpen) return;
    // The page scrolls under the pointer; the explanation stays beside its term.
    const follow = () => setPlace((before) => before && placeBeside(button.current!));
    addEventListener("scroll", follow, true);
    return () => removeEventListener("scroll", follow, true);
  }, [isOpen]);
  return (
    <span class="term" onMouseEnter={open} onMouseLeave={close}>
      <button
        ref={button}
        type="button"
        aria-describedby={place && id}
        onFocus={open}
        onBlur={close}
        onClick={open}
        onKeyDown={(e) => e.key === "Escape" && close()}
      >
        {children}
      </button>
      {place && (
        <span role="tooltip" id={id} style={place} popover="manual" ref={show}>
          {GLOSSARY[of]}
        </span>
      )}
    </span>
  );
}
