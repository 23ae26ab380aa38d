/** Maps addresses to views. */
import type { FaultCode } from "../api/types";
import { EmptyState } from "../parts/empty-state";
import { lazy } from "../parts/lazy";
import { FleetPage } from "../pages/fleet";
import { Link } from "../router/link";
import { lessonsPath } from "../router/paths";
import { Redirect } from "../router/redirect";

const AssetPage = lazy(() => import("../pages/asset").then((module) => module.AssetPage));
const FaultPage = lazy(() => import("../pages/fault").then((module) => module.FaultPage));
const SessionsPage = lazy(() => import("../pages/sessions").then((module) => module.SessionsPage));
const SessionPage = lazy(() => import("../pages/session").then((module) => module.SessionPage));
const ComparePage = lazy(() => import("../pages/compare").then((module) => module.ComparePage));
const SetUpPage = lazy(() => import("../pages/set-up").then((module) => module.SetUpPage));
const CalibrationsPage = lazy(() =>
  import("../pages/calibrations").then((module) => module.CalibrationsPage),
);
const AdministrationPage = lazy(() =>
  import("../pages/administration").then((module) => module.AdministrationPage),
);
const AlarmsPage = lazy(() => import("../pages/alarms").then((module) => module.AlarmsPage));
const NotificationsPage = lazy(() =>
  import("../pages/notifications").then((module) => module.NotificationsPage),
);
const SessionReport = lazy(() =>
  import("../pages/report/session-report").then((module) => module.SessionReport),
);
const FaultReport = lazy(() => import("../pages/report/fault-report").then((module) => module.FaultReport));
const JobsPage = lazy(() => import("../pages/jobs").then((module) => module.JobsPage));
const LearnPage = lazy(() => import("../pages/learn").then((module) => module.LearnPage));

/** The view at the path of `segments`; `isDemo` selects the controls of the demo. */
export function Route({ segments, isDemo }: { segments: string[]; isDemo: boolean }) {
  const [first, name, second, code, fifth] = segments;
  if (!first) return <FleetPage />;
  if (first === "rigs" && name) {
    if (!second) return <AssetPage name={name} />;
    // The service answers 404 for an unknown code.
    if (second === "faults" && code && fifth === "report")
      return <FaultReport key={name + code} name={name} code={code as FaultCode} />;
    if (second === "faults" && code) return <FaultPage name={name} code={code as FaultCode} />;
    if (second === "calibrations") return <CalibrationsPage key={name} name={name} />;
    if (second === "set-up") return <SetUpPage key={name} name={name} />;
  }
  if (first === "set-up") return <SetUpPage />;
  if (first === "sessions" && name && second === "report") return <SessionReport key={name} id={name} />;
  if (first === "sessions" && name) return <SessionPage key={name} id={name} />;
  if (first === "sessions") return <SessionsPage />;
  if (first === "compare") return <ComparePage />;
  if (first === "alarms") return <AlarmsPage />;
  if (first === "notifications") return <NotificationsPage />;
  if (first === "jobs") return <JobsPage />;
  if (first === "administration") return <AdministrationPage />;
  if (first === "demo") return <Redirect to={lessonsPath()} />;
  if (first === "learn") return <LearnPage isDemo={isDemo} />;
  return (
    <main>
      <EmptyState title="Page not found">
        <p>
          <Link to="/">Go to the fleet</Link>
        </p>
      </EmptyState>
    </main>
  );
}
