/** Who is in front of the page: where the service asks for a token, it is asked for here. */
import { createContext, type ComponentChildren } from "preact";
import { useContext, useEffect, useState } from "preact/hooks";
import { shut, whenShut } from "../api/access";
import { api, isUnauthenticated } from "../api/client";
import type { Caller } from "../api/types";
import { useAsk, useTitle } from "../hooks";
import { Act, Loading, Trouble } from "./bits";

const Who = createContext<Caller | undefined>(undefined);

/** Who asks; a service without tokens lets everyone do everything. */
export const useCaller = () => useContext(Who);

/** The page for whoever is known, else the way in. */
export function Door({ children }: { children: ComponentChildren }) {
  const caller = useAsk(api.caller, "caller");
  useEffect(() => whenShut(() => void caller.again()), [caller.again]);
  if (isUnauthenticated(caller.error)) return <LogIn done={caller.again} />;
  if (caller.data) return <Who.Provider value={caller.data}>{children}</Who.Provider>;
  return (
    <main>
      {caller.error ? (
        <Trouble error={caller.error} again={() => void caller.again()} />
      ) : (
        <Loading what="the page" />
      )}
    </main>
  );
}

function LogIn({ done }: { done: () => Promise<void> }) {
  useTitle("Log in");
  const [token, setToken] = useState("");
  const [error, setError] = useState<unknown>();
  const enter = async (event: Event) => {
    event.preventDefault();
    setError(undefined);
    try {
      await api.logIn(token.trim());
      await done();
    } catch (wrong) {
      setError(wrong);
    }
  };
  return (
    <main class="log-in">
      <h1>offbd</h1>
      <form class="card" onSubmit={enter}>
        <label>
          Token{" "}
          <input
            type="password"
            name="token"
            autocomplete="current-password"
            required
            autofocus
            value={token}
            placeholder="offbd_…"
            onInput={(e) => setToken(e.currentTarget.value)}
          />
        </label>
        <p class="quiet small-text">
          This service asks who is there. An administrator makes tokens:{" "}
          <code>offbd token create --name NAME --role viewer</code>
        </p>
        <Trouble error={error} />
        <div class="form-end">
          <button type="submit" class="primary">
            Log in
          </button>
        </div>
      </form>
    </main>
  );
}

/** Who is logged in, and the way out. */
export function Leave() {
  const caller = useCaller();
  if (!caller?.name) return null;
  const leave = () => api.logOut().then(shut);
  return (
    <span class="who">
      <span class="quiet" title={`role ${caller.role}`}>
        {caller.name}
      </span>{" "}
      <Act class="small" act={leave}>
        Log out
      </Act>
    </span>
  );
}

/** The token that a device's snippet shows: a place for it, or a new one for who may make it. */
export function DeviceToken({ asset, made }: { asset: string; made: (secret: string) => void }) {
  const caller = useCaller();
  if (caller?.authentication !== "required") {
    return (
      <>The service asks for no token. Whoever reaches this address can send; keep it within your network.</>
    );
  }
  const make = async () => made((await api.createDeviceToken(asset)).secret);
  return (
    <>
      The device shows its token; put it where the snippet says <code>offbd_TOKEN</code>.
      {caller.role === "admin" ? (
        <>
          {" "}
          <Act class="small" act={make}>
            Make a token for this rig
          </Act>{" "}
          It is shown this once.
        </>
      ) : (
        " An administrator makes one."
      )}
    </>
  );
}
