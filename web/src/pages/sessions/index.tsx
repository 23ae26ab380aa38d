/** The page of all sessions, with the import of recordings. */
import { useState } from "preact/hooks";
import { isNotFound } from "../../api/request";
import { useRigNames } from "../../hooks/use-rig-names";
import { useTitle } from "../../hooks/use-title";
import { ActionButton } from "../../parts/action-button";
import { ErrorMessage } from "../../parts/error-message";
import { lazy, Suspense } from "../../parts/lazy";
import { Loading } from "../../parts/loading";
import { Link } from "../../router/link";
import { jobsPath } from "../../router/paths";
import { DropZone } from "./drop-zone";
import { NoSession, UnknownRig } from "./no-session";
import { isFiltered } from "./session-filter";
import { SessionTable } from "./session-table";
import { SessionTools } from "./session-tools";
import type { Dropped } from "./use-file-drop";
import { useSessionFilter } from "./use-session-filter";
import { useSessions } from "./use-sessions";

/** Loaded when a file is chosen, as it contains the CSV parser. */
const ImportDialog = lazy(() => import("../import").then((module) => module.ImportDialog));

export function SessionsPage() {
  useTitle("Sessions");
  const { filter, word, change } = useSessionFilter();
  const { items: sessions, error, refetch, loadMore } = useSessions(filter);
  const names = useRigNames();
  const isUnknown = filter.asset !== undefined && isNotFound(error);
  const [dropped, setDropped] = useState<Dropped>();
  const close = () => setDropped((now) => (now === dropped ? undefined : now));
  return (
    <main>
      <header class="page-head">
        <h1>Sessions</h1>
        <div class="page-tools">
          <Link to={jobsPath()}>Jobs</Link>
        </div>
      </header>
      <DropZone take={setDropped} />
      {dropped && (
        <Suspense fallback={null}>
          <ImportDialog
            key={dropped.file.name + dropped.file.lastModified}
            {...dropped}
            assets={names}
            asset={filter.asset}
            close={close}
          />
        </Suspense>
      )}
      <SessionTools names={names} word={word} change={change} />
      {isUnknown ? <UnknownRig name={word("asset")} /> : <ErrorMessage error={error} retry={refetch} />}
      {!sessions && !error && <Loading what="the sessions" />}
      {sessions?.length === 0 && <NoSession isFiltered={isFiltered(filter)} />}
      {sessions && sessions.length > 0 && <SessionTable sessions={sessions} />}
      {loadMore && (
        <p>
          <ActionButton action={loadMore}>Show more</ActionButton>
        </p>
      )}
    </main>
  );
}
