import { isFinished } from "../../api/poll";
import type { Asset, CalibrationJob } from "../../api/types";
import { CalibrationDetails } from "./calibration-details";

/** How the learning goes, and what was learnt. */
export function Learnt({ asset, job }: { asset: Asset; job?: CalibrationJob }) {
  const { calibration } = asset;
  return (
    <section class="card">
      <h2>What was learnt</h2>
      {job && !isFinished(job) && (
        <p role="status">
          <span class="spinner" aria-hidden="true" /> Learning…
        </p>
      )}
      {job?.state === "failed" && (
        <p class="trouble" role="alert">
          {job.error}
        </p>
      )}
      {job?.state === "done" && (
        <p class="wait wait-good" role="status">
          <b>Learnt.</b> The next session is judged by it.
        </p>
      )}
      {!calibration && !job && <p class="quiet">Nothing yet. Until then only large faults are found.</p>}
      {calibration && <CalibrationDetails name={asset.name} calibration={calibration} />}
    </section>
  );
}
