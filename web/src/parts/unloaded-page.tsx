import { isNotFound } from "../api/request";
import { Link } from "../router/link";
import { EmptyState } from "./empty-state";
import { ErrorMessage } from "./error-message";
import { Loading } from "./loading";

interface Props {
  /** The heading above an error. */
  title?: string;
  /** What is loading. */
  what: string;
  /** What is asked for, if it may not exist: rig, fault, session. */
  kind?: string;
  /** Whether the page has shown it already: it was deleted meanwhile. */
  wasShown?: boolean;
  error: unknown;
  retry: () => Promise<unknown>;
}

/** A page without data: either loading or with an error. */
export function UnloadedPage({ title, what, kind = "page", wasShown, error, retry }: Props) {
  return (
    <main>
      {error ? (
        <>
          {title && <h1>{title}</h1>}
          {isNotFound(error) ? (
            <div role="alert">
              <EmptyState title={wasShown ? `This ${kind} has been deleted` : `There is no such ${kind}`}>
                <p>
                  {wasShown
                    ? "Somebody deleted it while this page was open, with its recordings and faults."
                    : "Its name may be mistyped, or it has been deleted."}{" "}
                  <Link to="/">Go to the fleet</Link>
                </p>
              </EmptyState>
            </div>
          ) : (
            <ErrorMessage error={error} retry={retry} />
          )}
        </>
      ) : (
        <Loading what={what} />
      )}
    </main>
  );
}
