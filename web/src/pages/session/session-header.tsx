import { useState } from "preact/hooks";
import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { ConfirmButton } from "../../parts/confirm-button";
import { useRefusal } from "../../parts/login/rights";
import { Link } from "../../router/link";
import { rigPath, sessionReportPath, sessionsPath } from "../../router/paths";
import { AFTER_THE_END } from "../../words/session";
import { DeleteDialog } from "./delete-dialog";
import { Download } from "./download";

export function SessionHeader({ session, refetch }: { session: Session; refetch: () => Promise<void> }) {
  const { id, name, asset, state } = session;
  const [isDeleting, setDeleting] = useState(false);
  const cannotDelete = useRefusal("admin");
  const end = () => api.endSession(id).then(refetch);
  return (
    <>
      <header class="page-head">
        <div>
          <p class="crumbs">
            <Link to={sessionsPath()}>Sessions</Link> / <Link to={rigPath(asset)}>{asset}</Link>
          </p>
          <h1>{name}</h1>
        </div>
        <div class="page-tools">
          <Link class="button" to={sessionReportPath(id)}>
            Report
          </Link>
          <Download session={session} />
          {state === "open" ? (
            <ConfirmButton word="End session" question="End this session?" action={end} needs="operator">
              Its verdict becomes final. {AFTER_THE_END}
            </ConfirmButton>
          ) : (
            <button
              type="button"
              disabled={cannotDelete !== undefined}
              title={cannotDelete}
              onClick={() => setDeleting(true)}
            >
              Delete
            </button>
          )}
        </div>
      </header>
      {isDeleting && <DeleteDialog session={session} close={() => setDeleting(false)} />}
    </>
  );
}
