import { isFinished } from "../../api/poll";
import type { Asset, CalibrationJob } from "../../api/types";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { jobText } from "../../words/job";
import { CalibrationDetails } from "./calibration-details";
import { NothingLearnt } from "./nothing-learnt";

/** The progress of the calibration, and its result. */
export function Learnt({ asset, job }: { asset: Asset; job?: CalibrationJob }) {
  const { calibration } = asset;
  return (
    <section class="card">
      <h2>Calibration</h2>
      {job && !isFinished(job) && (
        <p role="status">
          <span class="spinner" aria-hidden="true" /> {jobText(job, "Calibrating")}
        </p>
      )}
      {job?.state === "failed" && (
        <p class="trouble" role="alert">
          {job.error}
        </p>
      )}
      {job?.state === "done" && (
        <p class="wait wait-good" role="status">
          <b>Calibrated.</b> {job.active && "Used from the next session on."}
        </p>
      )}
      {!calibration && !job && <NothingLearnt asset={asset.name} />}
      {calibration && (
        <>
          <CalibrationDetails calibration={calibration} />
          <p>
            <Link class="button primary" to={rigPath(asset.name)}>
              Done: open the live view
            </Link>
          </p>
        </>
      )}
    </section>
  );
}
