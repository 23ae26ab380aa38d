import { useState } from "preact/hooks";
import { api } from "../../api/client";
import { useTitle } from "../../hooks/use-title";
import { ErrorMessage } from "../error-message";

export function LoginPage({ loggedIn }: { loggedIn: () => Promise<void> }) {
  useTitle("Log in");
  const [token, setToken] = useState("");
  const [error, setError] = useState<unknown>();
  const logIn = async (event: Event) => {
    event.preventDefault();
    setError(undefined);
    try {
      await api.logIn(token.trim());
      await loggedIn();
    } catch (thrown) {
      setError(thrown);
    }
  };
  return (
    <main class="log-in">
      <h1>offbd</h1>
      <form class="card" onSubmit={logIn}>
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
          This service requires a token. An administrator creates one on the page Administration, or with{" "}
          <code>offbd token create --name NAME --role viewer</code>
        </p>
        <ErrorMessage error={error} />
        <div class="form-end">
          <button type="submit" class="primary">
            Log in
          </button>
        </div>
      </form>
    </main>
  );
}
