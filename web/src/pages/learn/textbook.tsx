import { useState } from "preact/hooks";
import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { ErrorMessage } from "../../parts/error-message";
import { exampleSession } from "./example-session";
import { JudgedByProfile } from "./judged-by-profile";
import { TextbookText } from "./textbook-text";

const INTERVAL_MS = 10_000;

/** A shorter session shows nothing. */
const LEAST_SAMPLES = 500;

const fetchSessions = async () => {
  const { items } = await api.sessions({ limit: 50 });
  return items.filter((session) => session.samples > LEAST_SAMPLES);
};

/** One session without a fault, judged by both profiles. */
export function Textbook() {
  const { data: sessions, error } = useQuery(fetchSessions, "sessions", INTERVAL_MS);
  const [id, setId] = useState("");
  const chosen = sessions && exampleSession(sessions, id);
  return (
    <section class="card">
      <h2>Why 0.01 m/s² fails on a real rig</h2>
      <TextbookText />
      <ErrorMessage error={error} />
      {sessions?.length === 0 && (
        <p class="note">
          There is no session to show it on yet. Run <code>offbd demo</code>, or import a recording.
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
          <div class="pair">
            {["default", "textbook"].map((profile) => (
              <JudgedByProfile key={chosen.id + profile} session={chosen} profile={profile} />
            ))}
          </div>
        </>
      )}
    </section>
  );
}
