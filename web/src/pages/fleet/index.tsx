/** The page of all rigs: health, faults and lag. */
import { useTitle } from "../../hooks/use-title";
import { ErrorMessage } from "../../parts/error-message";
import { SavedViews } from "../../parts/saved-views/saved-views";
import { UnloadedPage } from "../../parts/unloaded-page";
import { EmptyFleet } from "./empty-fleet";
import { EventFeed } from "./event-feed";
import { FleetList } from "./fleet-list";
import { FleetTools } from "./fleet-tools";
import { FleetWall } from "./wall";
import { useFleet } from "./use-fleet";
import { useFleetView } from "./use-fleet-view";

export function FleetPage() {
  const { fleet, seenAt, error, refetch, lines } = useFleet();
  const view = useFleetView(fleet);
  useTitle("Fleet");
  if (!fleet) return <UnloadedPage title="Fleet" what="the fleet" error={error} retry={refetch} />;
  if (!fleet.length) return <EmptyFleet error={error} />;
  return (
    <main class="fleet">
      <header class="page-head">
        <h1>Fleet</h1>
        <div class="page-tools">
          <SavedViews page="/" />
        </div>
      </header>
      <ErrorMessage error={error} />
      <FleetTools view={view} />
      {view.layout === "wall" ? (
        <FleetWall rows={view.shown} />
      ) : (
        <div class="fleet-columns">
          <FleetList view={view} seenAt={seenAt} />
          <EventFeed lines={lines} />
        </div>
      )}
    </main>
  );
}
