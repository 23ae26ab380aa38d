import type { FaultEntry, HistoryEntry } from "../../api/types";
import { EmptyState } from "../../parts/empty-state";
import { codeMeaning, codeTitle } from "../../words/fault-names";
import { sentence } from "../../words/sentence";
import { isActive } from "./is-active";

/** The fault in a sentence, or that it is not active. */
export function FaultSummary({ fault, history }: { fault: FaultEntry; history: HistoryEntry[] }) {
  const { code, status } = fault;
  const latest = history.find(({ fault, what }) => fault && (what === "confirmed" || what === "pending"));
  if (latest?.fault && isActive(fault)) return <p class="sentence">{sentence(latest.fault.summary)}</p>;
  return (
    <EmptyState title={status === "cleared" ? "Nothing is on record" : "On record, but not active"}>
      <p>
        {codeTitle(code)}: {codeMeaning(code)}.{" "}
        {status === "healed"
          ? "Enough good sessions followed, so it has healed."
          : "Nothing of it has been found since it was last cleared."}
      </p>
    </EmptyState>
  );
}
