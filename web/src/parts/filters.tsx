import type { ComponentChildren } from "preact";
import { useMedia } from "../hooks/use-media";

interface Props {
  /** How many of the filters select something. */
  n: number;
  children: ComponentChildren;
}

/** The filters of a list: on a phone they are folded away, so that the list is on the screen. */
export function Filters({ n, children }: Props) {
  const isPhone = useMedia("(max-width: 700px)");
  if (!isPhone) return <div class="form-row">{children}</div>;
  return (
    <details class="filters">
      <summary>Filter and order{n > 0 && ` (${n})`}</summary>
      <div class="form-row">{children}</div>
    </details>
  );
}
