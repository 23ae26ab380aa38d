import { useEffect, useMemo, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Asset, AssetAxes } from "../../api/types";
import { PlayoutClock } from "../../live/playout-clock";
import { compareSigns, DEFAULT_AXES, type Signs } from "../../live/signs";
import { LiveCard } from "./live-card";
import { SignsCard } from "./signs-card";
import { useWatchedRig } from "./use-watched-rig";

/** Interval of the comparison, ms. */
const COMPARE_MS = 1000;

/** Duration of the path in the plan view, s. */
const TAIL_S = 3;

interface Props {
  asset: Asset;
  /** Fetches the rig's description again. */
  changed: () => Promise<void>;
  next: () => void;
}

/** The check of signs, axes and units against the twin. */
export function Check({ asset, changed, next }: Props) {
  const { state, buffer, isSending } = useWatchedRig(asset.name);
  const playout = useMemo(() => new PlayoutClock(), []);
  const [signs, setSigns] = useState<Signs>();
  const [hasEnded, setEnded] = useState(false);
  useEffect(() => {
    const timer = setInterval(() => setSigns(compareSigns(buffer)), COMPARE_MS);
    return () => clearInterval(timer);
  }, [buffer]);
  const axes: AssetAxes = { ...DEFAULT_AXES, ...asset.axes };
  // Earlier samples had other axes, so a new session starts and the comparison is reset.
  const change = async (part: Partial<AssetAxes>) => {
    await api.putAsset({ ...asset, axes: { ...axes, ...part } }, asset);
    if (state?.session_id) {
      await api.endSession(state.session_id);
      setEnded(true);
    }
    buffer.clear();
    setSigns(undefined);
    await changed();
  };
  const moment = () => {
    if (!buffer.t.length) return null;
    return { buffer, t: playout.tick(performance.now(), buffer.last), tail: TAIL_S };
  };
  return (
    <div class="pair">
      <LiveCard asset={asset} state={state} isSending={isSending} hasEnded={hasEnded} moment={moment} />
      <SignsCard axes={axes} signs={signs} evidence={state?.evidence} change={change} next={next} />
    </div>
  );
}
