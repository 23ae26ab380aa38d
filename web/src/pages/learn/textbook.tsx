import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { Choice } from "../../parts/choice";
import { ErrorMessage } from "../../parts/error-message";
import { exampleSession } from "./example-session";
import { Comparison } from "./comparison";
import { TextbookText } from "./textbook-text";

const INTERVAL_MS = 2000;

/** Shortest duration of an example, s. */
const SHORTEST_S = 5;

const isLong = ({ first_t_s: first, last_t_s: last }: Session) =>
  first != null && last != null && last - first >= SHORTEST_S;

const fetchSessions = async () => (await api.sessions({ limit: 50 })).items;

/** A stretch without a fault, judged with both profiles. */
export function Textbook() {
  const { data: all, error } = useQuery(fetchSessions, "sessions", INTERVAL_MS);
  const sessions = all?.filter(isLong);
  const [id, setId] = useState("");
  /** Sessions without a healthy stretch, which are not examples unless they are chosen. */
  const [unfit, setUnfit] = useState<ReadonlySet<string>>(new Set());
  const fit = sessions?.filter((session) => !unfit.has(session.id) || session.id === id);
  const chosen = sessions && (exampleSession(fit ?? [], id) ?? sessions[0]);
  const skip = (skipped: string) => setUnfit((before) => new Set(before).add(skipped));
  const choices = sessions?.map(({ id, asset, name }) => [id, `${asset}: ${name}`] as const) ?? [];
  return (
    <section class="card">
      <h2>Why 0.01 m/s² fails on a real rig</h2>
      <TextbookText />
      <ErrorMessage error={error} />
      {sessions?.length === 0 && (
        <p class="note">
          {all?.length ? (
            "The sessions are too short to compare yet: it takes a few seconds."
          ) : (
            <>
              There is no session to compare yet. Run <code>offbd demo</code>, or import a recording.
            </>
          )}
        </p>
      )}
      {chosen && (
        <>
          <Choice isInline label="Session" options={choices} value={chosen.id} change={setId} />
          <Comparison key={chosen.id} session={chosen} unfit={skip} />
        </>
      )}
    </section>
  );
}
