/** The page of one session: playback, verdict, and judging again with other settings. */
import { api } from "../../api/client";
import type { Asset } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { UnloadedPage } from "../../parts/unloaded-page";
import { SessionDetails } from "./session-details";

/** A promise that never resolves, while the rig of the session is not known yet. */
const never = () => new Promise<Asset>(() => {});

export function SessionPage({ id }: { id: string }) {
  const session = useQuery(() => api.session(id), id);
  const name = session.data?.asset;
  const asset = useQuery(() => (name ? api.asset(name) : never()), name);
  const faults = useQuery(() => api.sessionFaults(id), `${id} faults`);
  useTitle(session.data ? session.data.name : "Session");
  const error = session.error ?? asset.error;
  if (!session.data || !asset.data)
    return (
      <UnloadedPage title="Session" what="the session" kind="session" error={error} retry={session.refetch} />
    );
  return (
    <SessionDetails
      session={session.data}
      asset={asset.data}
      faults={faults.data ?? []}
      refetch={session.refetch}
    />
  );
}
