import { api } from "../../api/client";
import { ConfirmButton } from "../../parts/confirm-button";
import { HealthMark } from "../../parts/health-mark";
import { Link } from "../../router/link";
import { calibrationsPath, sessionsPath, setUpPath } from "../../router/paths";
import { AFTER_THE_END } from "../../words/session";
import type { RigHealth } from "../../words/severity";
import { DeleteRig } from "./delete-rig";
import { RigTags } from "./rig-tags";

interface Props {
  name: string;
  health: RigHealth;
  /** The id of the open session, if there is one. */
  session?: string | null;
}

export function AssetHeader({ name, health, session }: Props) {
  return (
    <header class="page-head">
      <div>
        <p class="crumbs">
          <Link to="/">Fleet</Link>
        </p>
        <h1>
          {name} <HealthMark health={health} />
        </h1>
        <RigTags asset={name} />
      </div>
      <div class="page-tools">
        <Link class="button" to={sessionsPath(name)}>
          Sessions
        </Link>
        <Link class="button" to={calibrationsPath(name)}>
          Calibrations
        </Link>
        <Link class="button" to={setUpPath(name)}>
          Set-up
        </Link>
        {session && (
          <ConfirmButton
            word="End session"
            question="End the running session?"
            action={() => api.endSession(session)}
            needs="operator"
          >
            Its verdict becomes final. {AFTER_THE_END}
          </ConfirmButton>
        )}
        <DeleteRig name={name} />
      </div>
    </header>
  );
}
