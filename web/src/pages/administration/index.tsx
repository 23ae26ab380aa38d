/** The page of administrators: who may do what, and who did what. */
import { administration } from "../../api/administration";
import { usePages } from "../../hooks/use-pages";
import { useQuery } from "../../hooks/use-query";
import { useTitle } from "../../hooks/use-title";
import { useRefusal } from "../../parts/login/rights";
import { AuditCard } from "./audit-card";
import { TokensCard } from "./tokens-card";

const INTERVAL_MS = 5000;

/** The cards; each of their requests needs the role admin. */
function Cards() {
  const tokens = useQuery(administration.tokens, "tokens", INTERVAL_MS);
  const audit = usePages(administration.audit, "audit", INTERVAL_MS);
  const changed = () => Promise.all([tokens.refetch(), audit.refetch()]);
  const nameOf = (id: string) => tokens.data?.find((token) => token.id === id)?.name;
  return (
    <>
      <TokensCard query={tokens} changed={changed} />
      <AuditCard list={audit} tokenName={nameOf} />
    </>
  );
}

export function AdministrationPage() {
  useTitle("Administration");
  const refused = useRefusal("admin");
  return (
    <main>
      <header class="page-head">
        <h1>Administration</h1>
      </header>
      {refused ? <p class="note">Tokens and the audit log are for administrators. {refused}</p> : <Cards />}
    </main>
  );
}
