import { useRef } from "preact/hooks";
import { FORMATS, type FormatName } from "../../api/formats";
import { useRefusal } from "../../parts/login/rights";
import { useFeature } from "../../parts/service-health";
import { useFileDrop, type Dropped } from "./use-file-drop";

/** The suffixes of the names of the files that are proposed, by format; others can be chosen, too. */
const SUFFIXES: [FormatName, string][] = [
  ["csv", ".csv,.txt,.tsv,text/csv"],
  ["json", ".json,.jsonl,.ndjson"],
  ["xlsx", ".xlsx"],
  ["parquet", ".parquet"],
  ["arrow", ".arrow,.arrows"],
  ["mcap", ".mcap"],
];

/** Lists words: a, b or c. */
const oneOf = (words: string[]) =>
  words.length > 1 ? `${words.slice(0, -1).join(", ")} or ${words.at(-1)}` : words.join();

/** The area for dropping or choosing a recording to import. */
export function DropZone({ take }: { take: (dropped: Dropped) => void }) {
  const isOver = useFileDrop(take);
  const isBuilt = useFeature();
  const refused = useRefusal("operator");
  const read = SUFFIXES.filter(([format]) => isBuilt(FORMATS[format].feature));
  const words = oneOf(read.map(([format]) => FORMATS[format].word));
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
        accept={read.map(([, suffixes]) => suffixes).join()}
        class="hidden"
        aria-label="Recording to import"
        tabIndex={-1}
        onChange={chosen}
      />
      <span>{isOver ? "Release to import" : `Drop a recording here (${words}), or`}</span>{" "}
      {!isOver && (
        <button
          type="button"
          disabled={refused !== undefined}
          title={refused}
          onClick={() => input.current?.click()}
        >
          choose a file
        </button>
      )}
    </div>
  );
}
