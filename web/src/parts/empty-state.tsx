import type { ComponentChildren } from "preact";

/** What stands where there is nothing to show: that there is nothing, and what to do. */
export function EmptyState({ title, children }: { title: string; children?: ComponentChildren }) {
  return (
    <div class="empty">
      <h2>{title}</h2>
      {children}
    </div>
  );
}
