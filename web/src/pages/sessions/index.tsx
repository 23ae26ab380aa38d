/** The page of all sessions, with the import of recordings. */
import { useState } from "preact/hooks";
import { api } from "../../api/client";
import { isNotFound } from "../../api/request";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { ActionButton } from "../../parts/action-button";
import { EmptyState } from "../../parts/empty-state";
import { ErrorMessage } from "../../parts/error-message";
import { lazy, Suspense } from "../../parts/lazy";
import { Loading } from "../../parts/loading";
import { useLocation } from "../../router/navigation";
import { Link } from "../../router/link";
import { sessionsPath } from "../../router/paths";
import { DropZone } from "./drop-zone";
import { SessionTable } from "./session-table";
import { SessionTools } from "./session-tools";
import { useSessions } from "./use-sessions";

/** Loaded when a file is chosen, as it contains the CSV parser. */
const ImportDialog = lazy(() => import("../import").then((module) => module.ImportDialog));

const fetchNames = () => api.fleet().then((fleet) => fleet.map((entry) => entry.asset));

function UnknownRig({ name }: { name: string }) {
  return (
    <EmptyState title={`There is no rig called ${name}`}>
      <p>
        Its name may be mistyped, or it has been deleted. <Link to={sessionsPath()}>Show all sessions</Link>
      </p>
    </EmptyState>
  );
}

export function SessionsPage() {
  useTitle("Sessions");
  const { query } = useLocation();
  const [asset, tag] = [query.get("asset") ?? "", query.get("tag") ?? ""];
  const { sessions, error, refetch, loadMore } = useSessions(asset, tag);
  const { data: known } = useQuery(fetchNames, "names");
  const names = known ?? [];
  const isUnknown = asset !== "" && isNotFound(error);
  const [file, setFile] = useState<File>();
  const close = () => setFile((now) => (now === file ? undefined : now));
  return (
    <main>
      <header class="page-head">
        <h1>Sessions</h1>
        <div class="page-tools">
          <SessionTools names={names} asset={asset} tag={tag} />
        </div>
      </header>
      <DropZone take={setFile} />
      {file && (
        <Suspense fallback={null}>
          <ImportDialog
            key={file.name + file.lastModified}
            file={file}
            assets={names}
            asset={asset || undefined}
            close={close}
          />
        </Suspense>
      )}
      {isUnknown ? <UnknownRig name={asset} /> : <ErrorMessage error={error} retry={refetch} />}
      {!sessions && !error && <Loading what="the sessions" />}
      {sessions?.length === 0 && (
        <EmptyState title="No session yet">
          <p>A session begins when a rig sends its first sample, or when a recording is imported.</p>
        </EmptyState>
      )}
      {sessions && sessions.length > 0 && <SessionTable sessions={sessions} />}
      {loadMore && (
        <p>
          <ActionButton action={loadMore}>Show more</ActionButton>
        </p>
      )}
    </main>
  );
}
