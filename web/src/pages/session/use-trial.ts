import { useEffect, useRef, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Trial } from "../../api/types";
import type { ProfileOrRecorded } from "./profile-choice";
import { isTried, trialQuery, type TriedSettings } from "./trial";

/** Delay after the last move of a slider before the request, ms. */
const DELAY_MS = 200;

export interface TrialState {
  /** What was found with the settings of the last answer. */
  trial?: Trial;
  /** What is found while nothing is tried, to compare with. */
  baseline?: Trial;
  error?: unknown;
}

interface Options {
  session: string;
  profile: ProfileOrRecorded;
  settings: TriedSettings;
  /** Whether anybody looks at the result: a trial judges the whole session. */
  isWanted: boolean;
}

/** Asks what other settings would find, one request after the other; only the latest settings count. */
export function useTrial({ session, profile, settings, isWanted }: Options): TrialState {
  /** The last answers, and the profile that they are of. */
  const [state, setState] = useState<TrialState & { of: ProfileOrRecorded }>({ of: profile });
  const inFlight = useRef<Promise<void>>(Promise.resolve());
  useEffect(() => {
    if (!isWanted) return;
    let isStale = false;
    const found = (trial: Trial) =>
      setState((before) => {
        const known = before.of === profile ? before.baseline : undefined;
        return { of: profile, trial, baseline: isTried(settings) ? known : trial };
      });
    const ask = async () => {
      await inFlight.current;
      if (isStale) return;
      const query = { ...trialQuery(settings), profile: profile || undefined };
      inFlight.current = api.trial(session, query).then(
        (trial) => void (isStale || found(trial)),
        (error: unknown) => void (isStale || setState({ of: profile, error })),
      );
    };
    const timer = setTimeout(() => void ask(), DELAY_MS);
    return () => {
      isStale = true;
      clearTimeout(timer);
    };
  }, [session, profile, settings, isWanted]);
  return state.of === profile ? state : {};
}
