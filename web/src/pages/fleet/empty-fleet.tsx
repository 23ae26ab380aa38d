import { EmptyState } from "../../parts/empty-state";
import { ErrorMessage } from "../../parts/error-message";
import { Link } from "../../router/link";

export function EmptyFleet({ error }: { error: unknown }) {
  return (
    <main>
      <h1>Fleet</h1>
      <ErrorMessage error={error} />
      <EmptyState title="No rig yet">
        <p>Describe your rig, send its telemetry, and see it here: it takes about five minutes.</p>
        <p>
          <Link to="/set-up" class="button primary">
            Set up a rig
          </Link>{" "}
          <span class="quiet">
            or run <code>offbd demo</code> for a simulated one.
          </span>
        </p>
      </EmptyState>
    </main>
  );
}
