import { errorText } from "../api/request";
import type { Delayed } from "../hooks/use-delayed";

/** What is about to happen, with the button that takes it back; the error if it failed. */
export function UndoNote({ delayed, text }: { delayed: Delayed; text: string }) {
  const { isWaiting, error, undo } = delayed;
  return (
    <>
      {isWaiting && (
        <span role="status">
          {text}{" "}
          <button type="button" onClick={undo}>
            Undo
          </button>
        </span>
      )}
      {error !== undefined && (
        <span class="trouble-inline" role="alert">
          {errorText(error)}
        </span>
      )}
    </>
  );
}
