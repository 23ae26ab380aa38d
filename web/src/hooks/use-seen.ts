import { useEffect, useState } from "preact/hooks";

/** Whether an element has been on the screen, and the reference to give it: it may be rendered later. */
export function useSeen<T extends Element>() {
  const [element, setElement] = useState<T | null>(null);
  const [isSeen, setSeen] = useState(false);
  useEffect(() => {
    if (isSeen || !element) return;
    const observer = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) setSeen(true);
    });
    observer.observe(element);
    return () => observer.disconnect();
  }, [isSeen, element]);
  return { ref: setElement, isSeen };
}
