import type { ComponentChildren } from "preact";
import { navigate, rememberScroll } from "./navigation";

type Props = { to: string; children: ComponentChildren; class?: string; "aria-current"?: "page" };

/** A link within the page, followed without a reload unless a modifier key requests a new tab or a download. */
export function Link({ to, children, ...rest }: Props) {
  const follow = (event: MouseEvent) => {
    const hasModifier = event.metaKey || event.ctrlKey || event.shiftKey || event.altKey;
    if (event.button !== 0 || hasModifier) return;
    event.preventDefault();
    rememberScroll();
    navigate(to);
    scrollTo(0, 0);
  };
  return (
    <a href={to} onClick={follow} {...rest}>
      {children}
    </a>
  );
}
