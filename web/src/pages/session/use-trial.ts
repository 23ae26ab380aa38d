import { useEffect, useRef, useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Trial } from "../../api/types";
import type { ProfileOrRecorded } from "./profile-choice";
import { isTried, trialQuery, type TriedSettings } from "./trial";

/** Delay after the last move of a slider before the request, ms. */
const DELAY_MS = 200;

export interface TrialState {
  /** What was found with the settings of the last answer; undefined while nothing is tried. */
  trial?: Trial;
  error?: unknown;
}

/** Asks what other settings would find, one request after the other; only the latest settings count. */
export function useTrial(session: string, profile: ProfileOrRecorded, settings: TriedSettings): TrialState {
  const [state, setState] = useState<TrialState>({});
  const inFlight = useRef<Promise<void>>(Promise.resolve());
  useEffect(() => {
    let isStale = false;
    if (!isTried(settings)) {
      setState({});
      return;
    }
    const ask = async () => {
      await inFlight.current;
      if (isStale) return;
      const query = { ...trialQuery(settings), profile: profile || undefined };
      inFlight.current = api.trial(session, query).then(
        (trial) => void (isStale || setState({ trial })),
        (error: unknown) => void (isStale || setState({ error })),
      );
    };
    const timer = setTimeout(() => void ask(), DELAY_MS);
    return () => {
      isStale = true;
      clearTimeout(timer);
    };
  }, [session, profile, settings]);
  return state;
}
