import type { Demo } from "../../api/types";
import { faultList } from "./demo-faults";

/** The injected faults, and whether the script or a visitor controls them. */
export function DemoStatus({ demo: { broken, script } }: { demo: Demo }) {
  return (
    <p class="grow" role="status">
      {broken.length ? (
        <>
          Injected faults: <b>{faultList(broken)}</b>.
        </>
      ) : (
        "The simulated rig is healthy."
      )}{" "}
      <span class="quiet">
        {script
          ? "A script breaks and repairs the rig until you press a button."
          : "The script is paused: you control the faults."}
      </span>
    </p>
  );
}
