import type { FaultEntry } from "../../api/types";
import { Facts } from "../../parts/facts";
import { causesOf } from "../../words/verdict";
import { faultFacts } from "./fault-facts";

/** The candidates of the diagnosis; without any, the fault itself unless it is cleared. */
function candidatesOf({ candidates, status, code, kind }: FaultEntry): FaultEntry["candidates"] {
  if (candidates.length) return candidates;
  return status === "cleared" ? [] : [{ code, kind, weight: 1 }];
}

/** The possible causes of the fault, and its record. */
export function Causes({ fault }: { fault: FaultEntry }) {
  const candidates = candidatesOf(fault);
  return (
    <section class="card">
      <h2>Possible causes</h2>
      {candidates.length === 0 && <p class="quiet">None.</p>}
      <ul class="candidates">
        {causesOf(candidates).map(({ title, meaning, weight }) => (
          <li>
            <span>
              <b>{title}</b>
              <br />
              <span class="quiet">{meaning}</span>
            </span>
            <meter min={0} max={1} value={weight} aria-label={`Weight of ${title}`} />
            <span class="n">{Math.round(weight * 100)} %</span>
          </li>
        ))}
      </ul>
      <Facts facts={faultFacts(fault)} />
    </section>
  );
}
