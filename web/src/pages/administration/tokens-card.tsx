import { useState } from "preact/hooks";
import type { Token } from "../../api/administration";
import type { NewToken } from "../../api/types";
import type { Query } from "../../hooks/use-query";
import { Dialog } from "../../parts/dialog";
import { ErrorMessage } from "../../parts/error-message";
import { Loading } from "../../parts/loading";
import { useCaller } from "../../parts/login/caller";
import { MadeToken } from "./made-token";
import { TokenForm } from "./token-form";
import { TokenTable } from "./token-table";

interface Props {
  query: Query<Token[]>;
  changed: () => Promise<unknown>;
}

/** The tokens of people and devices: listed, created and revoked. */
export function TokensCard({ query, changed }: Props) {
  const { data: tokens, error, refetch } = query;
  const [isOpen, setOpen] = useState(false);
  const [made, setMade] = useState<NewToken>();
  const isOff = useCaller()?.authentication === "off";
  const take = (token: NewToken) => {
    setOpen(false);
    setMade(token);
    void changed();
  };
  return (
    <section class="card">
      <h2>Tokens</h2>
      {isOff && (
        <p class="note">
          The service requires no token at present: whoever reaches it has all rights. It asks for tokens with{" "}
          <code>auth = "required"</code> in its configuration.
        </p>
      )}
      {made && <MadeToken token={made} close={() => setMade(undefined)} />}
      <ErrorMessage error={error} retry={refetch} />
      {!tokens && !error && <Loading what="the tokens" />}
      {tokens && <TokenTable tokens={tokens} changed={changed} />}
      <p>
        <button type="button" onClick={() => setOpen(true)}>
          Create a token
        </button>
      </p>
      {isOpen && (
        <Dialog title="Create a token" close={() => setOpen(false)}>
          <TokenForm made={take} />
        </Dialog>
      )}
    </section>
  );
}
