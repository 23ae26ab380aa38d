/** The controls of the demo, the comparison with the textbook's limit, and the benchmarks. */
import { useTitle } from "../../hooks/use-title";
import { Benchmarks } from "./benchmarks";
import { DemoControls } from "./demo-controls";
import { ExercisesCard } from "./exercises-card";
import { Textbook } from "./textbook";

export function LearnPage({ isDemo }: { isDemo: boolean }) {
  useTitle("Lessons");
  return (
    <main>
      <h1>Lessons</h1>
      {isDemo ? (
        <DemoControls />
      ) : (
        <p class="note">
          With <code>offbd demo</code>, this page injects faults into a simulated rig.
        </p>
      )}
      <Textbook />
      <ExercisesCard />
      <Benchmarks />
    </main>
  );
}
