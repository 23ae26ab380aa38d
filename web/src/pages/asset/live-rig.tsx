import type { Alarm } from "../../api/alarms";
import type { Asset, FaultEntry, State } from "../../api/types";
import { RigView } from "../../parts/rig-view/rig-view";
import { XyTrace } from "../../parts/xy-trace/xy-trace";
import { count } from "../../words/numbers";
import { ActiveFaults } from "./active-faults";
import { AssetHeader } from "./asset-header";
import { DriveCycleCard } from "./drive-cycle/drive-cycle-card";
import { activeFaults, healthOf } from "./health";
import { LastSession } from "./last-session";
import { LearningCard } from "./learning/learning-card";
import { LinkCard } from "./link-card";
import { LiveChartsCard } from "./live-charts-card";
import { LostCommunication } from "./lost-communication";
import { Monitors } from "./monitors";
import { NowCard } from "./now-card";
import { TrendWarnings } from "./trends/trend-warnings";
import { TrendsCard } from "./trends/trends-card";
import { useTrends } from "./trends/use-trends";
import { TwinCard } from "./twin-card";
import { useLiveRig } from "./use-live-rig";

interface Props {
  asset: Asset;
  faults: FaultEntry[];
  /** The alarm that data of the rig stay away, if they do. */
  lost?: Alarm;
  /** Fetches the rig's description and its alarms again. */
  refetch: () => Promise<unknown>;
}

/** What keeps the page from showing the rig as it is now. */
function Notices({ isLost, state }: { isLost: boolean; state?: State }) {
  return (
    <>
      {isLost && (
        <p class="trouble" role="alert">
          Connection lost; reconnecting. The page shows the last received data.
        </p>
      )}
      {state?.unjudged && (
        <p class="trouble" role="alert">
          Not tested: {count(state.unjudged.samples)} recent samples could not be used (
          {state.unjudged.reason}).
        </p>
      )}
    </>
  );
}

export function LiveRig({ asset, faults, lost, refetch }: Props) {
  const { state, connection, isSilent, isStill, charts } = useLiveRig(asset.name, () => void refetch());
  const trends = useTrends(asset.name);
  const active = activeFaults(faults);
  const isLost = connection === "lost";
  const hasSession = !isLost && state?.session_id != null;
  const presence = !hasSession ? "ended" : isSilent || lost ? "silent" : "arriving";
  const health = healthOf(active, state, {
    isConnected: connection === "live",
    isLost,
    isSilent: presence === "silent",
    isLearnt: asset.calibration != null,
  });
  const still = isStill ? { t_s: state?.t_s, at: lost?.since } : undefined;
  return (
    <main class="asset">
      <AssetHeader name={asset.name} health={health} session={state?.session_id} />
      <Notices isLost={isLost} state={state} />
      {lost && <LostCommunication alarm={lost} refetch={refetch} />}
      <ActiveFaults asset={asset.name} faults={active} presence={presence} />
      <TrendWarnings trends={trends.data} />
      <LearningCard
        name={asset.name}
        state={state}
        changed={() => Promise.all([refetch(), trends.refetch()])}
      />
      {state && !state.session_id && <LastSession name={asset.name} />}
      <div class="live-top">
        <RigView asset={asset} pose={charts.pose} name={`${asset.name}-live`} />
        <div class="live-side">
          <section class="card">
            <h2>From above</h2>
            <XyTrace asset={asset} moment={charts.moment} />
          </section>
          <Monitors asset={asset.name} monitors={state?.monitors ?? []} />
        </div>
      </div>
      {(!state || state.session_id) && <LiveChartsCard charts={charts} still={still} />}
      <div class="pair">
        <NowCard state={state} />
        <TwinCard asset={asset} state={state} />
      </div>
      <LinkCard asset={asset.name} />
      <DriveCycleCard asset={asset} />
      <TrendsCard query={trends} />
    </main>
  );
}
