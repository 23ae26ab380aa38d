import type { JobState } from "./types";

const INTERVAL_MS = 300;

/** Fetches repeatedly until `done` returns true for a response; calls `show` with every response. */
export async function poll<T>(
  fetch: () => Promise<T>,
  done: (response: T) => boolean,
  show: (response: T) => void = () => {},
): Promise<T> {
  for (;;) {
    const response = await fetch();
    show(response);
    if (done(response)) return response;
    await new Promise((resume) => setTimeout(resume, INTERVAL_MS));
  }
}

/** Whether a background job has ended, successfully or not. */
export const isFinished = (job: { state: JobState }) => job.state === "done" || job.state === "failed";
