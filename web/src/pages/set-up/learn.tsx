import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset, CalibrationJob } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { AFTER_THE_END } from "../../words/session";
import { proposedSessions, totalLength, withChoice } from "./chosen-sessions";
import { learnFrom } from "./learn-from";
import { Learnt } from "./learnt";
import { LengthStatus } from "./length-status";
import { NoSession } from "./no-session";
import { SessionChoice } from "./session-choice";

/** Polling interval, ms: a session that is being recorded grows. */
const INTERVAL_MS = 2000;

/** The calibration: the choice of sessions, and the result. */
export function Learn({ asset, changed }: { asset: Asset; changed: () => Promise<void> }) {
  const fetchSessions = () => api.sessions({ asset: asset.name, limit: 20 }).then((page) => page.items);
  const { data: sessions, error } = useQuery(fetchSessions, `${asset.name} sessions`, INTERVAL_MS);
  /** The user's choice; before it, the proposal applies, which may change. */
  const [ownChoice, setOwnChoice] = useState<ReadonlySet<string>>();
  const [job, setJob] = useState<CalibrationJob>();
  const chosen = ownChoice ?? proposedSessions(sessions);
  const hasOpen = sessions?.some(({ id, state }) => state === "open" && chosen.has(id));
  const learn = async () => {
    if (await learnFrom(asset.name, [...chosen], sessions ?? [], setJob)) await changed();
  };
  return (
    <div class="pair">
      <section class="card">
        <h2>Healthy sessions</h2>
        <p>
          Let the ball roll over the whole plate for a minute or two, in circles or figures of eight. The rig
          must be healthy meanwhile: later sessions are compared with this motion. A resting ball gives no
          information.
        </p>
        <ErrorMessage error={error} />
        {sessions?.length === 0 && <NoSession asset={asset.name} />}
        <ul class="choose">
          {sessions?.map((session) => (
            <SessionChoice
              session={session}
              isChosen={chosen.has(session.id)}
              choose={(isWanted) => setOwnChoice(withChoice(chosen, session.id, isWanted))}
            />
          ))}
        </ul>
        {chosen.size > 0 && <LengthStatus seconds={totalLength(sessions ?? [], chosen)} />}
        {hasOpen && (
          <p class="note small-text">
            A chosen session is still being recorded: the calibration ends it. {AFTER_THE_END}
          </p>
        )}
        <div class="form-end">
          <ActionButton class="primary" action={learn} disabled={chosen.size === 0} needs="operator">
            {hasOpen ? "End the recording and calibrate" : "Calibrate"}
          </ActionButton>
        </div>
      </section>
      <Learnt asset={asset} job={job} />
    </div>
  );
}
