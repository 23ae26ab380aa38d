/** The page of one rig: live view, monitors, charts, drive cycle and trends. */
import { alarmApi } from "../../api/alarms";
import { api } from "../../api/client";
import { isNotFound } from "../../api/request";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { UnloadedPage } from "../../parts/unloaded-page";
import { LiveRig } from "./live-rig";

/** Polling intervals of the rig's description and its faults, ms; events report changes earlier. */
const ASSET_MS = 15_000;
const FAULTS_MS = 5000;

export function AssetPage({ name }: { name: string }) {
  useTitle(name);
  const asset = useQuery(() => api.asset(name), name, ASSET_MS);
  const faults = useQuery(() => api.faultsOf(name), `${name} faults`, FAULTS_MS);
  const fetchLost = () => alarmApi.alarms({ asset: name, code: "communication_lost", state: "failing" });
  const lost = useQuery(fetchLost, `${name} communication`, FAULTS_MS);
  const refetch = () => Promise.all([faults.refetch(), lost.refetch(), asset.refetch()]);
  // The faults are asked for more often, so they tell of a deletion sooner.
  const error = isNotFound(faults.error) ? faults.error : asset.error;
  if (!asset.data || isNotFound(error))
    return (
      <UnloadedPage
        title={name}
        what={name}
        kind="rig"
        wasShown={asset.data !== undefined}
        error={error}
        retry={refetch}
      />
    );
  return (
    <LiveRig
      key={name}
      asset={asset.data}
      faults={faults.data ?? []}
      lost={lost.data?.items[0]}
      refetch={refetch}
    />
  );
}
