/** The page that compares two sessions: `/compare?a=…&b=…`. */
import { useTitle } from "../../hooks/use-title";
import { EmptyState } from "../../parts/empty-state";
import { UnloadedPage } from "../../parts/unloaded-page";
import { Link } from "../../router/link";
import { navigate, useLocation } from "../../router/navigation";
import { comparePath, sessionsPath } from "../../router/paths";
import { readCompare } from "./align";
import { Comparison } from "./comparison";
import { useRecordings } from "./use-recording";

export function ComparePage() {
  useTitle("Compare sessions");
  const { a, b, shift } = readCompare(useLocation().query);
  if (a && b) return <ComparedSessions key={`${a} ${b}`} a={a} b={b} shift={shift} />;
  return (
    <main>
      <EmptyState title="No two sessions are chosen">
        <p>
          Choose two in the <Link to={sessionsPath()}>list of sessions</Link>.
        </p>
      </EmptyState>
    </main>
  );
}

function ComparedSessions({ a, b, shift }: { a: string; b: string; shift: number }) {
  const { data, error, refetch } = useRecordings(a, b);
  if (!data)
    return (
      <UnloadedPage
        title="Compare sessions"
        what="the sessions"
        kind="session"
        error={error}
        retry={refetch}
      />
    );
  return (
    <main class="asset">
      <header class="page-head">
        <div>
          <p class="crumbs">
            <Link to={sessionsPath()}>Sessions</Link>
          </p>
          <h1>Compare sessions</h1>
        </div>
      </header>
      <Comparison
        a={data.a}
        b={data.b}
        shift={shift}
        setShift={(next) => navigate(comparePath(a, b, next), true)}
      />
    </main>
  );
}
