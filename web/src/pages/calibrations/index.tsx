/** The page with the calibrations of a rig: `/rigs/NAME/calibrations`. */
import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { UnloadedPage } from "../../parts/unloaded-page";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";
import { CalibrationList } from "./calibration-list";

/** Sessions that can be chosen to see the fit, the newest. */
const N_SESSIONS = 100;

/** Polling interval, ms. */
const INTERVAL_MS = 15_000;

export function CalibrationsPage({ name }: { name: string }) {
  useTitle(`Calibrations of ${name}`);
  const jobs = useQuery(() => api.calibrations(name), `${name} calibrations`, INTERVAL_MS);
  const sessions = useQuery(() => api.sessions({ asset: name, limit: N_SESSIONS }), `${name} sessions`);
  if (!jobs.data || !sessions.data) {
    const retry = () => Promise.all([jobs.refetch(), sessions.refetch()]);
    const error = jobs.error ?? sessions.error;
    return <UnloadedPage title={name} what="the calibrations" kind="rig" error={error} retry={retry} />;
  }
  return (
    <main>
      <header class="page-head">
        <div>
          <p class="crumbs">
            <Link to="/">Fleet</Link> / <Link to={rigPath(name)}>{name}</Link>
          </p>
          <h1>Calibrations</h1>
        </div>
      </header>
      <CalibrationList name={name} jobs={jobs.data} sessions={sessions.data.items} refetch={jobs.refetch} />
    </main>
  );
}
