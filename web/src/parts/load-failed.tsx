/** The message if the code of a view could not be loaded. */
export function LoadFailed() {
  return (
    <main>
      <p class="trouble" role="alert">
        This part of the page could not be loaded. The service may have been updated.{" "}
        <button type="button" onClick={() => location.reload()}>
          Reload the page
        </button>
      </p>
    </main>
  );
}
