import { errorText } from "../api/request";

/** What went wrong, if anything did, and a button to try again if there is a way. */
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
