import type { FaultEntry } from "../../api/types";
import { Facts } from "../../parts/facts";
import { codeMeaning, faultTitle, kindMeaning } from "../../words/fault-names";
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
        {candidates.map(({ code, kind, weight }) => (
          <li>
            <span>
              <b>{faultTitle({ code, kind })}</b>
              <br />
              <span class="quiet">{kind ? kindMeaning(kind) : codeMeaning(code)}</span>
            </span>
            <meter min={0} max={1} value={weight} aria-label={`Weight of ${faultTitle({ code, kind })}`} />
            <span class="n">{Math.round(weight * 100)} %</span>
          </li>
        ))}
      </ul>
      <Facts facts={faultFacts(fault)} />
    </section>
  );
}
