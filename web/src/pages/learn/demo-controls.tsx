import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { DemoFaultButtons } from "./demo-fault-buttons";
import { DemoGains } from "./demo-gains";
import { DemoStatus } from "./demo-status";

/** Polling interval, ms: other visitors of the demo may change its state too. */
const INTERVAL_MS = 700;

/** The controls that inject and repair faults of the demo's simulated rig. */
export function DemoControls() {
  const { data: demo, error, refetch } = useQuery(api.demo, "demo", INTERVAL_MS);
  if (!demo) return error ? <ErrorMessage error={error} /> : <Loading what="the demo" />;
  const { asset, script } = demo;
  const thenRefetch = (action: () => Promise<unknown>) => () => action().then(refetch);
  return (
    <section class="card">
      <h2>Inject faults</h2>
      <div class="card-head">
        <DemoStatus demo={demo} />
        <div class="page-tools">
          <Link class="button primary" to={rigPath(asset)}>
            Watch {asset}
          </Link>
          <ActionButton action={thenRefetch(api.repairDemo)} needs="operator">
            Repair all
          </ActionButton>
          <ActionButton action={thenRefetch(api.resumeDemoScript)} disabled={script} needs="operator">
            Resume the script
          </ActionButton>
        </div>
      </div>
      <DemoFaultButtons demo={demo} inject={(fault) => thenRefetch(() => api.injectDemoFault(fault))()} />
      <p class="quiet small-text">
        A fault is detected when a command depends on the broken part, mostly within one to three seconds. It
        stays on record after the repair until you clear it on its page, or it heals because enough sessions
        without it followed; a fault that is injected again is cleared first, so that its detection can be
        watched.
      </p>
      <DemoGains />
    </section>
  );
}
