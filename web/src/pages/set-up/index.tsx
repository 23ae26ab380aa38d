/** The set-up of a rig in four steps: describe, connect, check, learn. */
import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { UnloadedPage } from "../../parts/unloaded-page";
import { Link } from "../../router/link";
import { navigate, useLocation } from "../../router/navigation";
import { rigPath, setUpPath, type SetUpStep } from "../../router/paths";
import { Check } from "./check";
import { Connect } from "./connect";
import { Describe } from "./describe";
import { Learn } from "./learn";
import { Steps, STEPS } from "./steps";

/** The step in the address; a new rig is described first. */
function useStep(name?: string): SetUpStep {
  const { query } = useLocation();
  const wanted = STEPS.find(({ key }) => key === query.get("step"));
  return (name && wanted?.key) || "describe";
}

/** Whether a session of the rig has samples. */
async function hasSamples(name?: string): Promise<boolean> {
  if (!name) return false;
  const { items } = await api.sessions({ asset: name, limit: 20 });
  return items.some((session) => session.samples > 0);
}

/** The set-up of a rig, or of a new one if `name` is missing. */
export function SetUpPage({ name }: { name?: string }) {
  const title = name ? `Set up ${name}` : "Set up a rig";
  useTitle(title);
  const fetchAsset = () => (name ? api.asset(name) : Promise.resolve(undefined));
  const { data: asset, error, refetch } = useQuery(fetchAsset, name ?? "new");
  const step = useStep(name);
  const samples = useQuery(() => hasSamples(name), `${name} ${step} samples`);
  if (name && !asset)
    return <UnloadedPage title={title} what={name} kind="rig" error={error} retry={refetch} />;
  const goTo = (next: SetUpStep) => navigate(setUpPath(name!, next));
  // The next steps change the description, as it is now.
  const refetchKnown = (described: string) => (described === name ? refetch() : undefined);
  const connect = (described: string) => navigate(setUpPath(described, "connect"));
  return (
    <main class="set-up">
      <header class="page-head">
        <div>
          {name && (
            <p class="crumbs">
              <Link to="/">Fleet</Link> / <Link to={rigPath(name)}>{name}</Link>
            </p>
          )}
          <h1>{title}</h1>
        </div>
      </header>
      <Steps current={step} asset={asset} hasSamples={samples.data ?? false} goTo={name ? goTo : undefined} />
      {step === "describe" && <Describe asset={asset} saved={refetchKnown} next={connect} />}
      {step === "connect" && asset && <Connect asset={asset} next={() => goTo("check")} />}
      {step === "check" && asset && <Check asset={asset} changed={refetch} next={() => goTo("learn")} />}
      {step === "learn" && asset && <Learn asset={asset} changed={refetch} />}
    </main>
  );
}
