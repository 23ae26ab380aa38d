import { ErrorMessage } from "./error-message";
import { Loading } from "./loading";

interface Props {
  /** The heading above an error. */
  title?: string;
  /** What is loading. */
  what: string;
  error: unknown;
  retry: () => Promise<unknown>;
}

/** A page without data: either loading or with an error. */
export function UnloadedPage({ title, what, error, retry }: Props) {
  return (
    <main>
      {error ? (
        <>
          {title && <h1>{title}</h1>}
          <ErrorMessage error={error} retry={retry} />
        </>
      ) : (
        <Loading what={what} />
      )}
    </main>
  );
}
