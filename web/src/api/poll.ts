const INTERVAL_MS = 300;

/** Fetches until `done` is true of an answer; `show` is told each. */
export async function poll<T>(
  fetch: () => Promise<T>,
  done: (answer: T) => boolean,
  show: (answer: T) => void = () => {},
): Promise<T> {
  for (;;) {
    const answer = await fetch();
    show(answer);
    if (done(answer)) return answer;
    await new Promise((resume) => setTimeout(resume, INTERVAL_MS));
  }
}

/** Whether a job of the service has come to its end, good or bad. */
export const isFinished = (job: { state: string }) => job.state === "done" || job.state === "failed";
