import type { ComponentChildren } from "preact";

export type Fact = [name: ComponentChildren, value: ComponentChildren];

/** A definition list of names and values, in columns. */
export function Facts({ facts }: { facts: Fact[] }) {
  return (
    <dl class="facts">
      {facts.map(([name, value]) => (
        <div>
          <dt>{name}</dt>
          <dd>{value}</dd>
        </div>
      ))}
    </dl>
  );
}
