import type { Monitor } from "../../api/types";
import { Term } from "../../parts/term";
import { MonitorRow } from "./monitor-row";

export function Monitors({ asset, monitors }: { asset: string; monitors: Monitor[] }) {
  return (
    <section class="card">
      <h2>Monitors</h2>
      {monitors.length === 0 && <p class="quiet">Waiting for data.</p>}
      <ul class="monitors">
        {monitors.map((monitor) => (
          <MonitorRow asset={asset} monitor={monitor} />
        ))}
      </ul>
      <p class="quiet small-text">
        The bar shows the <Term of="counter">fault detection counter</Term>, from −128 (passed) to 127
        (failed). ✓: the test has completed in this session.
      </p>
    </section>
  );
}
