import { useEffect, useState } from "preact/hooks";
import { guessMapping, type Mapping } from "./mapping";
import { readTable, type Table } from "./table";

/** Largest file, bytes; also the default limit of the service. */
const MAX_BYTES = 64 << 20;

export interface RecordingFile {
  table: Table;
  mapping: Mapping;
}

/** Returns the text of a file: UTF-16 if a byte order mark says so, otherwise UTF-8. */
function textOf(bytes: Uint8Array): string {
  const mark = `${bytes[0]},${bytes[1]}`;
  const encoding = { "255,254": "utf-16le", "254,255": "utf-16be" }[mark] ?? "utf-8";
  return new TextDecoder(encoding).decode(bytes);
}

async function read(file: File): Promise<RecordingFile> {
  if (file.size > MAX_BYTES) throw new Error("The file is larger than 64 MiB. Split it.");
  const table = readTable(textOf(new Uint8Array(await file.arrayBuffer())));
  return { table, mapping: guessMapping(table) };
}

/** Reads a file as a table with an editable mapping, or returns the problem; neither while it is being read. */
export function useRecordingFile(file: File) {
  const [recording, setRecording] = useState<RecordingFile>();
  const [problem, setProblem] = useState<string>();
  useEffect(() => {
    read(file).then(setRecording, (error: Error) => setProblem(error.message));
  }, [file]);
  const setMapping = (mapping: Mapping) => setRecording((before) => before && { ...before, mapping });
  return { recording, problem, setMapping };
}
