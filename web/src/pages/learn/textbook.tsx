import { useState } from "preact/hooks";
import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { ErrorMessage } from "../../parts/error-message";
import { exampleSession } from "./example-session";
import { Comparison } from "./comparison";
import { TextbookText } from "./textbook-text";

const INTERVAL_MS = 10_000;

/** Smallest number of samples of an example. */
const MIN_SAMPLES = 500;

const fetchSessions = async () => {
  const { items } = await api.sessions({ limit: 50 });
  return items.filter((session) => session.samples > MIN_SAMPLES);
};

/** A stretch without a fault, judged with both profiles. */
export function Textbook() {
  const { data: sessions, error } = useQuery(fetchSessions, "sessions", INTERVAL_MS);
  const [id, setId] = useState("");
  /** Sessions without a healthy stretch, which are no examples unless they are chosen. */
  const [unfit, setUnfit] = useState<ReadonlySet<string>>(new Set());
  const fit = sessions?.filter((session) => !unfit.has(session.id) || session.id === id);
  const chosen = sessions && (exampleSession(fit ?? [], id) ?? sessions[0]);
  const skip = (skipped: string) => setUnfit((before) => new Set(before).add(skipped));
  return (
    <section class="card">
      <h2>Why 0.01 m/s² fails on a real rig</h2>
      <TextbookText />
      <ErrorMessage error={error} />
      {sessions?.length === 0 && (
        <p class="note">
          There is no session to compare yet. Run <code>offbd demo</code>, or import a recording.
        </p>
      )}
      {chosen && (
        <>
          <label class="inline">
            Session{" "}
            <select value={chosen.id} onChange={(e) => setId(e.currentTarget.value)}>
              {sessions.map(({ id, asset, name }) => (
                <option value={id}>
                  {asset}: {name}
                </option>
              ))}
            </select>
          </label>
          <Comparison key={chosen.id} session={chosen} unfit={skip} />
        </>
      )}
    </section>
  );
}
