import { isFinished } from "../../api/poll";
import type { Asset, FaultLine, Session } from "../../api/types";
import { useReplay } from "../../hooks/use-replay";
import { Link } from "../../router/link";
import { jobsPath } from "../../router/paths";
import { jobText } from "../../words/job";
import { ReplayFields } from "./replay-fields";
import { replaySettings } from "./replay-settings";
import { ReplayVerdict } from "./replay-verdict";

interface Props {
  session: Session;
  /** Its rig, as it is described now. */
  asset: Asset;
  /** Its fault lines. */
  faults: FaultLine[];
}

export function JudgeAgain({ session, asset, faults }: Props) {
  const { replay, judge } = useReplay(session.id);
  return (
    <section class="card">
      <h2>Judge again</h2>
      <p class="quiet">
        Judges the same samples with other settings, or with a description of the rig that was corrected
        since. The session itself is not changed.
      </p>
      <ReplayFields judge={(form) => judge(replaySettings(form, asset))} />
      {replay && !isFinished(replay) && (
        <p role="status">
          {replay.waits ? (
            <Link to={jobsPath()}>{jobText(replay, "Judging")}</Link>
          ) : (
            jobText(replay, "Judging")
          )}{" "}
          <progress value={replay.progress} max={1} aria-label="Progress" />
        </p>
      )}
      {replay?.error && (
        <p class="trouble" role="alert">
          {replay.error}
        </p>
      )}
      {replay?.result && (
        <ReplayVerdict
          session={session}
          faults={faults}
          result={replay.result}
          profile={replay.settings.profile}
        />
      )}
    </section>
  );
}
