import { EmptyState } from "../../parts/empty-state";
import { Link } from "../../router/link";
import { sessionsPath } from "../../router/paths";

/** What is said instead of a list that has no session. */
export function NoSession({ isFiltered }: { isFiltered: boolean }) {
  if (isFiltered)
    return (
      <EmptyState title="No session matches">
        <p>
          <Link to={sessionsPath()}>Show all sessions</Link>
        </p>
      </EmptyState>
    );
  return (
    <EmptyState title="No session yet">
      <p>A session begins when a rig sends its first sample, or when a recording is imported.</p>
    </EmptyState>
  );
}

export function UnknownRig({ name }: { name: string }) {
  return (
    <EmptyState title={`There is no rig called ${name}`}>
      <p>
        Its name may be mistyped, or it has been deleted. <Link to={sessionsPath()}>Show all sessions</Link>
      </p>
    </EmptyState>
  );
}
