/** What stands in the place of a view whose code cannot be loaded. */
export function LoadFailed() {
  return (
    <main>
      <p class="trouble" role="alert">
        This part of the page cannot be loaded; the service may have been replaced by a newer one.{" "}
        <button type="button" onClick={() => location.reload()}>
          Load the page anew
        </button>
      </p>
    </main>
  );
}
