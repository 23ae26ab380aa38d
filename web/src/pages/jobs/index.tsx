/** The background jobs: what runs, what waits for what, and how to cancel it. */
import { jobApi } from "../../api/jobs";
import { useNow } from "../../hooks/use-now";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { EmptyState } from "../../parts/empty-state";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { JobRow } from "./job-row";

const INTERVAL_MS = 1000;

export function JobsPage() {
  const { data: jobs, error, refetch } = useQuery(jobApi.jobs, "jobs", INTERVAL_MS);
  useTitle("Jobs");
  const now = useNow();
  return (
    <main>
      <header class="page-head">
        <h1>Jobs</h1>
      </header>
      <p class="quiet">
        Sessions that are judged again, and calibrations. Short jobs come first, and the rigs have equal
        shares; calibrations that rigs start by themselves have their own queue.
      </p>
      <ErrorMessage error={error} retry={refetch} />
      {!jobs && !error && <Loading what="the jobs" />}
      {jobs?.length === 0 && (
        <EmptyState title="No jobs">
          <p>Nothing runs, and nothing waits.</p>
        </EmptyState>
      )}
      {jobs && jobs.length > 0 && (
        <div class="scroll">
          <table class="list alarms">
            <thead>
              <tr>
                <th>Job</th>
                <th>Rig</th>
                <th>State</th>
                <th>Started by</th>
                <th>Asked for</th>
                <th>
                  <span class="hidden">Actions</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {jobs.map((job) => (
                <JobRow key={job.id} job={job} now={now} refetch={refetch} />
              ))}
            </tbody>
          </table>
        </div>
      )}
    </main>
  );
}
