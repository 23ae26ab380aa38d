import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { DemoFaultButtons } from "./demo-fault-buttons";
import { DemoStatus } from "./demo-status";

/** Visitors of one demo see each other's buttons, ms. */
const INTERVAL_MS = 700;

/** What breaks and repairs the simulated rig of the demo. */
export function DemoControls() {
  const { data: demo, error, refetch } = useQuery(api.demo, "demo", INTERVAL_MS);
  if (!demo) return error ? <ErrorMessage error={error} /> : <Loading what="the demo" />;
  const { asset, script } = demo;
  const thenRefetch = (action: () => Promise<unknown>) => () => action().then(refetch);
  return (
    <section class="card">
      <div class="card-head">
        <DemoStatus demo={demo} />
        <div class="page-tools">
          <Link class="button primary" to={rigPath(asset)}>
            Watch {asset}
          </Link>
          <ActionButton action={thenRefetch(api.repairDemo)}>Repair all</ActionButton>
          <ActionButton action={thenRefetch(api.resumeDemoScript)} disabled={script}>
            Back to the script
          </ActionButton>
        </div>
      </div>
      <DemoFaultButtons demo={demo} breakRig={(fault) => thenRefetch(() => api.breakDemo(fault))()} />
      <p class="quiet small-text">
        A fault shows as soon as the rig is asked to do what it no longer can: mostly within one to three
        seconds. It stays on record when the rig is repaired; clear it on its page.
      </p>
    </section>
  );
}
