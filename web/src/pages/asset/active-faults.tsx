import type { FaultEntry } from "../../api/types";
import { FaultChip } from "../../parts/fault-chip";
import { Link } from "../../router/link";
import { faultPath } from "../../router/paths";
import { faultMeaning } from "../../words/fault-names";
import { isPresent, stateOf, type Presence } from "../../words/fault-state";
import { standing } from "../../words/severity";
import { ambiguousCauses } from "../../words/verdict";

interface Props {
  asset: string;
  faults: FaultEntry[];
  presence: Presence;
}

/** A line for each fault of the rig: what is wrong, whether it is known to fail now, and since when. */
export function ActiveFaults({ asset, faults, presence }: Props) {
  if (!faults.length) return null;
  return (
    <ul class="banner-list" aria-label="Active faults">
      {faults.map((fault) => {
        const { code, candidates, last_occurrence } = fault;
        const state = stateOf(fault);
        return (
          <li>
            <Link to={faultPath(asset, code)} class={`banner banner-${standing(state)}`}>
              <FaultChip
                fault={{ ...fault, ...state }}
                presence={presence}
                since={last_occurrence?.noted_at}
              />{" "}
              <span>
                {ambiguousCauses(candidates) ||
                  faultMeaning(fault, !state.failing || !isPresent(state, presence))}
              </span>{" "}
              <span class="more">Look at it →</span>
            </Link>
          </li>
        );
      })}
    </ul>
  );
}
