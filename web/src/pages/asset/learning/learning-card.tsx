import { useEffect } from "preact/hooks";
import { api } from "../../../api/client";
import type { Learning, LearningState, State } from "../../../api/types";
import { useQuery } from "../../../hooks/use-query";
import { ActionButton } from "../../../parts/action-button";
import { ErrorMessage } from "../../../parts/error-message";
import { GatheringNote } from "./gathering-note";
import { MotionProgress } from "./motion-progress";
import { TeachingSessions } from "./teaching-sessions";

const TITLES: Record<LearningState, string> = {
  gathering: "This rig is not calibrated yet",
  learning: "Calibrating",
  offered: "Was the rig healthy while it was recorded?",
  learnt: "Calibrated automatically",
};

/** Polling interval once the rig is learnt, ms; before, every state contains the progress. */
const INTERVAL_MS = 15_000;

interface Props {
  name: string;
  state?: State;
  /** Called when the calibration has been accepted or discarded. */
  changed: () => Promise<unknown>;
}

/** The automatic calibration of a rig: its progress, and the question whether the rig was healthy. */
export function LearningCard({ name, state, changed }: Props) {
  const { data, error, refetch } = useQuery(() => api.learning(name), `${name} learning`, INTERVAL_MS);
  const live = state?.learning;
  const isSettled = state && !live;
  useEffect(() => {
    void refetch();
  }, [refetch, live?.state, isSettled]);
  const learning = live ?? data;
  if (!learning) return <ErrorMessage error={error} retry={refetch} />;
  if (learning.state === "learnt" && !learning.by_itself) return null;
  const afterwards = (action: (name: string) => Promise<Learning>) => async () => {
    await action(name);
    await Promise.all([refetch(), changed()]);
  };
  const discard = afterwards(api.discardLearning);
  const isGathering = learning.state === "gathering";
  return (
    <section class="card learning" aria-label="Calibration">
      <h2>{TITLES[learning.state]}</h2>
      <p>{learning.summary}</p>
      {isGathering && <MotionProgress learning={learning} />}
      <TeachingSessions sessions={learning.sessions} />
      {learning.state === "offered" && (
        <p class="page-tools">
          <ActionButton class="primary" action={afterwards(api.acceptLearning)} needs="operator">
            Yes, use this calibration
          </ActionButton>
          <ActionButton action={discard} needs="operator">
            No, start again
          </ActionButton>
        </p>
      )}
      {isGathering && learning.refused && (
        <p>
          <ActionButton action={discard} needs="operator">
            Start again
          </ActionButton>
        </p>
      )}
      {isGathering && <GatheringNote name={name} />}
    </section>
  );
}
