import { useRef } from "preact/hooks";
import { useFileDrop, type Dropped } from "./use-file-drop";

/** The suffixes of the names of the files that are proposed; others can be chosen, too. */
const SUFFIXES = ".csv,.txt,.tsv,.xlsx,.parquet,.arrow,.arrows,.mcap,text/csv";

/** The area for dropping or choosing a recording to import. */
export function DropZone({ take }: { take: (dropped: Dropped) => void }) {
  const isOver = useFileDrop(take);
  const input = useRef<HTMLInputElement>(null);
  const chosen = ({ currentTarget }: { currentTarget: HTMLInputElement }) => {
    const file = currentTarget.files?.[0];
    // Reset, so that the same file can be chosen again.
    currentTarget.value = "";
    if (file) take({ file, nOthers: 0 });
  };
  return (
    <div class={`drop${isOver ? " over" : ""}`}>
      <input
        ref={input}
        type="file"
        accept={SUFFIXES}
        class="hidden"
        aria-label="Recording to import"
        tabIndex={-1}
        onChange={chosen}
      />
      <span>
        {isOver ? "Release to import" : "Drop a recording here (CSV, Excel, Parquet, Arrow or MCAP), or"}
      </span>{" "}
      {!isOver && (
        <button type="button" onClick={() => input.current?.click()}>
          choose a file
        </button>
      )}
    </div>
  );
}
