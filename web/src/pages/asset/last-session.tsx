import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { Link } from "../../router/link";
import { sessionPath, setUpPath } from "../../router/paths";
import { dateTime } from "../../words/time";
import { verdict } from "../../words/verdict";

/** The note on a rig without an open session: its last session with the verdict, and how to begin one. */
export function LastSession({ name }: { name: string }) {
  const fetchLast = () => api.sessions({ asset: name, limit: 1 }).then(({ items }) => items[0] ?? null);
  const { data: last } = useQuery(fetchLast, `${name} last session`);
  const result = last?.verdict && verdict(last.verdict);
  return (
    <p class="note">
      No session is open: the drawings below are empty.{" "}
      {last && (
        <>
          The last one, <Link to={sessionPath(last.id)}>{last.name}</Link>, ended {dateTime(last.ended_at)}
          {result && (
            <>
              : <span class={result.look}>{result.text}</span>
            </>
          )}
          .{" "}
        </>
      )}
      A session is opened by the first sample.{" "}
      <Link to={setUpPath(name, "connect")}>How to send samples</Link>
    </p>
  );
}
