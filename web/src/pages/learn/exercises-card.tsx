import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { useQuery } from "../../hooks/use-query";
import { CodeBlock } from "../../parts/code-block";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { EXERCISES, sessionFor, type Exercise } from "./exercises";

const fetchSessions = async () => (await api.sessions({ limit: 100 })).items;

/** What to do and what to see, with a session for each exercise. */
export function ExercisesCard() {
  const { data } = useQuery(fetchSessions, "exercises");
  return (
    <section class="card">
      <h2>Exercises</h2>
      <p class="quiet">The three applications of the book&rsquo;s chapter.</p>
      {EXERCISES.map((exercise) => (
        <ExerciseText key={exercise.title} exercise={exercise} session={data && sessionFor(exercise, data)} />
      ))}
    </section>
  );
}

function ExerciseText({ exercise, session }: { exercise: Exercise; session?: Session }) {
  const { title, steps, seen, commands } = exercise;
  return (
    <details class="exercise">
      <summary>{title}</summary>
      <p>
        {session ? (
          <>
            Session: <Link to={sessionPath(session.id)}>{`${session.asset}, ${session.name}`}</Link>
          </>
        ) : (
          <span class="quiet">
            No ended session suits yet. The demo makes one: inject a fault if the exercise needs one, and end
            the session.
          </span>
        )}
      </p>
      <ol>
        {steps.map((step) => (
          <li>{step}</li>
        ))}
      </ol>
      <p>
        <b>What to see.</b> {seen}
      </p>
      <CodeBlock label="On the command line">{commands.join("\n")}</CodeBlock>
    </details>
  );
}
