import type { FaultEntry, HistoryEntry } from "../../api/types";
import { EmptyState } from "../../parts/empty-state";
import { codeMeaning, codeTitle } from "../../words/fault-names";
import { sentence } from "../../words/sentence";
import { isActive } from "./is-active";

/** The fault in one sentence, or the note that it is not active. */
export function FaultSummary({ fault, history }: { fault: FaultEntry; history: HistoryEntry[] }) {
  const { code, status } = fault;
  const latest = history.find(({ fault, what }) => fault && (what === "confirmed" || what === "pending"));
  if (latest?.fault && isActive(fault)) return <p class="sentence">{sentence(latest.fault.summary)}</p>;
  return (
    <EmptyState title={status === "cleared" ? "Nothing is on record" : "On record, but not active"}>
      <p>
        {codeTitle(code)}: {codeMeaning(code)}.{" "}
        {status === "healed"
          ? "It healed after enough sessions without the fault."
          : "It has not been detected since it was last cleared."}
      </p>
    </EmptyState>
  );
}
