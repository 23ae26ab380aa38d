/** The demo's buttons, and what there is to learn: why a textbook's limit fails, what speed costs. */
import { useTitle } from "../../hooks/use-title";
import { Benchmarks } from "./benchmarks";
import { DemoControls } from "./demo-controls";
import { Textbook } from "./textbook";

export function LearnPage({ isDemo }: { isDemo: boolean }) {
  useTitle(isDemo ? "Demo" : "Learn");
  return (
    <main>
      <h1>{isDemo ? "Break it" : "Learn"}</h1>
      {isDemo ? (
        <DemoControls />
      ) : (
        <p class="note">
          In <code>offbd demo</code> this page breaks a simulated rig at the press of a button.
        </p>
      )}
      <Textbook />
      <Benchmarks />
    </main>
  );
}
