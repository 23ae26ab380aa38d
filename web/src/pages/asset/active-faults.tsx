import type { FaultEntry } from "../../api/types";
import { FaultChip } from "../../parts/fault-chip";
import { Link } from "../../router/link";
import { faultPath } from "../../router/paths";
import { codeMeaning } from "../../words/fault-names";

export function ActiveFaults({ asset, faults }: { asset: string; faults: FaultEntry[] }) {
  if (!faults.length) return null;
  return (
    <ul class="banner-list" aria-label="Active faults">
      {faults.map((fault) => (
        <li>
          <Link to={faultPath(asset, fault.code)} class={`banner banner-${fault.status}`}>
            <FaultChip fault={fault} /> <span>{codeMeaning(fault.code)}</span>{" "}
            <span class="more">Look at it →</span>
          </Link>
        </li>
      ))}
    </ul>
  );
}
