import { useState } from "preact/hooks";
import { api } from "../api/client";
import { isFinished, poll } from "../api/poll";
import type { Replay, ReplaySettings } from "../api/types";

/** Judges a session again with other settings: the replay job, and the function that starts it. */
export function useReplay(session: string) {
  const [replay, setReplay] = useState<Replay>();
  const judge = async (settings: ReplaySettings) => {
    const begun = await api.replay(session, settings);
    setReplay(begun);
    await poll(() => api.replayState(begun.id), isFinished, setReplay);
  };
  return { replay, judge };
}
