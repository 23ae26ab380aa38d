import { errorText } from "../api/request";

/** The text of an error, if there is one, with a button to try again if `retry` is given. */
export function ErrorMessage({ error, retry }: { error: unknown; retry?: () => Promise<unknown> }) {
  if (!error) return null;
  return (
    <p class="trouble" role="alert">
      <span>{errorText(error)}</span>
      {retry && (
        <button type="button" onClick={() => void retry()}>
          Try again
        </button>
      )}
    </p>
  );
}
