import { useRef } from "preact/hooks";
import { useFileDrop } from "./use-file-drop";

/** The area for dropping or choosing a recording to import. */
export function DropZone({ take }: { take: (file: File) => void }) {
  const isOver = useFileDrop(take);
  const input = useRef<HTMLInputElement>(null);
  const chosen = ({ currentTarget }: { currentTarget: HTMLInputElement }) => {
    const file = currentTarget.files?.[0];
    // Reset, so that the same file can be chosen again.
    currentTarget.value = "";
    if (file) take(file);
  };
  return (
    <div class={`drop${isOver ? " over" : ""}`}>
      <input
        ref={input}
        type="file"
        accept=".csv,.txt,.tsv,text/csv"
        class="hidden"
        aria-label="Recording to import"
        tabIndex={-1}
        onChange={chosen}
      />
      <span>{isOver ? "Release to import" : "Drop a recording (CSV) here, or"}</span>{" "}
      {!isOver && (
        <button type="button" onClick={() => input.current?.click()}>
          choose a file
        </button>
      )}
    </div>
  );
}
