import { VirtualList } from "../../parts/virtual-list";
import { navigate } from "../../router/navigation";
import { count } from "../../words/numbers";
import { FleetRow } from "./fleet-row";
import type { FleetView } from "./use-fleet-view";
import { useRowHeight } from "./use-row-height";

export function FleetList({ view: { total, shown }, seenAt }: { view: FleetView; seenAt: number }) {
  const rowHeight = useRowHeight();
  return (
    <section aria-label="Rigs">
      <div class="fleet-row fleet-head" aria-hidden="true">
        <span>Rig</span>
        <span>State</span>
        <span>Faults</span>
        <span>Session</span>
        <span class="n">Lag</span>
        <span class="n">Last seen</span>
      </div>
      {shown.length ? (
        <VirtualList
          items={shown}
          rowHeight={rowHeight}
          label="Rigs"
          id={(row) => row.entry.asset}
          row={(row) => <FleetRow row={row} seenAt={seenAt} />}
        />
      ) : (
        <p class="quiet">
          No rig matches.{" "}
          <button type="button" class="link" onClick={() => navigate("/", true)}>
            Show all {count(total)}
          </button>
        </p>
      )}
    </section>
  );
}
