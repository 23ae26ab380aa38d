import { Link } from "../../router/link";
import { sessionsPath, setUpPath } from "../../router/paths";

export function NoSession({ asset }: { asset: string }) {
  return (
    <p class="note">
      There is no session yet. <Link to={setUpPath(asset, "connect")}>Connect the rig</Link> first, or{" "}
      <Link to={sessionsPath(asset)}>import a recording</Link>.
    </p>
  );
}
