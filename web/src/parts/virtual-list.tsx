/** A list of which only the visible rows are in the document. */
import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { rememberedScroll } from "../router/navigation";

/** Number of rows above and below the visible ones that are also in the document. */
const OVERSCAN = 6;

interface Props<T> {
  items: T[];
  rowHeight: number;
  label: string;
  row: (item: T) => ComponentChildren;
  id: (item: T) => string;
}

export function VirtualList<T>({ items, rowHeight, label, row, id }: Props<T>) {
  const element = useRef<HTMLDivElement>(null);
  const [range, setRange] = useState<[number, number]>([0, 30]);
  useEffect(() => {
    const measure = () => {
      // A scroll event may arrive between the unmount and the cleanup.
      if (!element.current) return;
      const box = element.current.getBoundingClientRect();
      const first = Math.max(Math.floor(-box.top / rowHeight) - OVERSCAN, 0);
      const last = Math.ceil((innerHeight - box.top) / rowHeight) + OVERSCAN;
      setRange((before) => (before[0] === first && before[1] === last ? before : [first, last]));
    };
    measure();
    addEventListener("scroll", measure, { passive: true });
    addEventListener("resize", measure);
    return () => {
      removeEventListener("scroll", measure);
      removeEventListener("resize", measure);
    };
  }, [rowHeight, items.length]);
  // Back on the page, the list is as long as before only now, so that the browser could not scroll to its place.
  useLayoutEffect(() => {
    const scroll = rememberedScroll();
    if (scroll !== undefined) scrollTo(0, scroll);
  }, []);
  const [first, last] = range;
  return (
    <div
      ref={element}
      class="virtual"
      style={{ height: `${items.length * rowHeight}px` }}
      role="list"
      aria-label={label}
    >
      {items.slice(first, last).map((item, i) => (
        <div
          key={id(item)}
          class="virtual-row"
          role="listitem"
          aria-setsize={items.length}
          aria-posinset={first + i + 1}
          style={{ height: `${rowHeight}px`, transform: `translateY(${(first + i) * rowHeight}px)` }}
        >
          {row(item)}
        </div>
      ))}
    </div>
  );
}
