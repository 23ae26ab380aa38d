/** A rig that learns by itself: how far it is, the question whether it was healthy, what was learnt. */
import { useEffect } from "preact/hooks";
import { api } from "../api/client";
import type { Learning, State } from "../api/types";
import { useAsk } from "../hooks";
import { at, Link } from "../router";
import { Act, Trouble } from "./bits";

const AXES = [
  ["x", "x_s"],
  ["y", "y_s"],
] as const;

/** How a rig stands: live while it is not learnt, asked for once it is. */
export function LearningCard({
  name,
  state,
  changed,
}: {
  name: string;
  state?: State;
  changed: () => Promise<void>;
}) {
  const asked = useAsk(() => api.learning(name), `${name} learning`, 15_000);
  const live = state?.learning;
  const settled = state && !live;
  useEffect(() => {
    void asked.again();
  }, [live?.state, settled]);
  const learning = live ?? asked.data;
  if (!learning) return <Trouble error={asked.error} again={() => void asked.again()} />;
  if (learning.state === "learnt" && !learning.by_itself) return null;
  const then = (act: () => Promise<Learning>) => async () => {
    await act();
    await Promise.all([asked.again(), changed()]);
  };
  return (
    <section class="card learning" aria-label="Learning">
      <h2>{TITLES[learning.state]}</h2>
      <p>{learning.summary}</p>
      {learning.state === "gathering" && <Progress of={learning} />}
      <Sessions of={learning} />
      {learning.state === "offered" && (
        <p class="page-tools">
          <Act class="primary" act={then(() => api.acceptLearning(name))}>
            Yes, use what was learnt
          </Act>
          <Act act={then(() => api.discardLearning(name))}>No, start again</Act>
        </p>
      )}
      {learning.state === "gathering" && learning.refused && (
        <p>
          <Act act={then(() => api.discardLearning(name))}>Start again</Act>
        </p>
      )}
      {learning.state === "gathering" && (
        <p class="quiet small-text">
          Until then only faults of the sensor are confirmed. The rig learns by itself while it runs; or{" "}
          <Link to={`${at("rigs", name, "set-up")}?step=learn`}>choose the recordings yourself</Link>.
        </p>
      )}
    </section>
  );
}

const TITLES: Record<Learning["state"], string> = {
  gathering: "This rig is not learnt yet",
  learning: "Being learnt",
  offered: "Ready: was the rig healthy?",
  learnt: "Learnt by itself",
};

function Progress({ of: learning }: { of: Learning }) {
  const axes = AXES.flatMap(([axis, key]) =>
    learning[key] == null ? [] : [{ axis, seconds: Math.min(learning[key], learning.wanted_s) }],
  );
  return (
    <ul class="learning-axes">
      {axes.map(({ axis, seconds }) => (
        <li>
          <span>{axis}</span>
          <progress max={learning.wanted_s} value={seconds} aria-label={`Motion along ${axis}`}>
            {Math.floor(seconds)} s
          </progress>
          <span class="quiet">
            {Math.floor(seconds)} of {Math.round(learning.wanted_s)} s
          </span>
        </li>
      ))}
    </ul>
  );
}

function Sessions({ of: { sessions } }: { of: Learning }) {
  if (!sessions.length) return null;
  return (
    <p class="quiet small-text">
      From{" "}
      {sessions.map(({ id, name }, i) => (
        <>
          {i > 0 && ", "}
          <Link to={at("sessions", id)}>{name}</Link>
        </>
      ))}
      .
    </p>
  );
}
