/** The requests about background jobs. */
import { get, segment, send } from "./request";
import type { CalibrationJob, Job, Page, Replay } from "./types";

export const jobApi = {
  jobs: () => get<Page<Job>>("/jobs").then((page) => page.items),
  cancel: ({ id, kind, asset }: Job) =>
    kind === "replay"
      ? send<Replay>("POST", `/replays/${segment(id)}/cancel`)
      : send<CalibrationJob>("POST", `/assets/${segment(asset)}/calibrations/${segment(id)}/cancel`),
};
