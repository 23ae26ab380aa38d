import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset, CalibrationJob } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { proposedSessions, totalLength, withChoice } from "./chosen-sessions";
import { learnFrom } from "./learn-from";
import { Learnt } from "./learnt";
import { LengthStatus } from "./length-status";
import { NoSession } from "./no-session";
import { SessionChoice } from "./session-choice";

/** A session that is recorded grows. */
const INTERVAL_MS = 2000;

/** The calibration: from which sessions, and what came of it. */
export function Learn({ asset, changed }: { asset: Asset; changed: () => Promise<void> }) {
  const fetchSessions = () => api.sessions({ asset: asset.name, limit: 20 }).then((page) => page.items);
  const { data: sessions, error } = useQuery(fetchSessions, `${asset.name} sessions`, INTERVAL_MS);
  /** Missing until somebody has chosen; until then it is what is proposed, which may change. */
  const [ownChoice, setOwnChoice] = useState<ReadonlySet<string>>();
  const [job, setJob] = useState<CalibrationJob>();
  const chosen = ownChoice ?? proposedSessions(sessions);
  const learn = async () => {
    if (await learnFrom(asset.name, [...chosen], sessions ?? [], setJob)) await changed();
  };
  return (
    <div class="pair">
      <section class="card">
        <h2>From a healthy minute</h2>
        <p>
          Let the ball roll all over the plate for a minute or two: circles, figures of eight. The rig must be
          healthy while it does; what it does now is what it is held to later. A ball that rests teaches
          nothing.
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
        <div class="form-end">
          <ActionButton class="primary" action={learn} disabled={chosen.size === 0}>
            Learn from {chosen.size === 1 ? "it" : "them"}
          </ActionButton>
        </div>
      </section>
      <Learnt asset={asset} job={job} />
    </div>
  );
}
