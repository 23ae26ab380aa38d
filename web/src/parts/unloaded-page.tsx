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
  error: unknown;
  retry: () => Promise<unknown>;
}

/** A page without data: either loading or with an error. */
export function UnloadedPage({ title, what, kind = "page", error, retry }: Props) {
  return (
    <main>
      {error ? (
        <>
          {title && <h1>{title}</h1>}
          {isNotFound(error) ? (
            <div role="alert">
              <EmptyState title={`There is no such ${kind}`}>
                <p>
                  Its name may be mistyped, or it has been deleted. <Link to="/">Go to the fleet</Link>
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
