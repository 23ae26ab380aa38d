import type { Demo } from "../../api/types";
import { faultList } from "./demo-faults";

/** What is broken now, and by whose hands. */
export function DemoStatus({ demo: { broken, script } }: { demo: Demo }) {
  return (
    <p class="grow" role="status">
      {broken.length ? (
        <>
          Broken now: <b>{faultList(broken)}</b>.
        </>
      ) : (
        "The simulated rig is whole."
      )}{" "}
      <span class="quiet">
        {script
          ? "A script breaks and repairs it by itself until you press a button."
          : "It is in your hands."}
      </span>
    </p>
  );
}
