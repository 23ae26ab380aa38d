import type { FaultEntry } from "../../api/types";
import { StatusChip } from "../../parts/status-chip";
import { Link } from "../../router/link";
import { faultReportPath, rigPath } from "../../router/paths";
import { faultTitle } from "../../words/fault-names";
import { presenceOf, stateOf } from "../../words/fault-state";
import { FaultActions } from "./fault-actions";

export function FaultHeader({ fault, refetch }: { fault: FaultEntry; refetch: () => Promise<unknown> }) {
  const { asset, code } = fault;
  return (
    <header class="page-head">
      <div>
        <p class="crumbs">
          <Link to="/">Fleet</Link> / <Link to={rigPath(asset)}>{asset}</Link>
        </p>
        <h1>
          {faultTitle(fault)} <StatusChip fault={stateOf(fault)} presence={presenceOf(fault)} />
        </h1>
        <Link to={faultReportPath(asset, code)}>Report to print</Link>
      </div>
      {fault.status !== "cleared" && <FaultActions fault={fault} refetch={refetch} />}
    </header>
  );
}
