import { useEffect, useState } from "preact/hooks";
import { guessMapping, type Mapping } from "./mapping";
import { readTable, type Table } from "./table";

/** Longest file that is read here, bytes: the service takes no longer one either, by default. */
const MAX_BYTES = 64 << 20;

export interface RecordingFile {
  table: Table;
  mapping: Mapping;
}

async function read(file: File): Promise<RecordingFile> {
  if (file.size > MAX_BYTES) throw new Error("The file is longer than 64 MiB; split it.");
  const table = readTable(await file.text());
  return { table, mapping: guessMapping(table) };
}

/** A file as a table with a mapping that can be changed, or why it is none; nothing while it is read. */
export function useRecordingFile(file: File) {
  const [recording, setRecording] = useState<RecordingFile>();
  const [problem, setProblem] = useState<string>();
  useEffect(() => {
    read(file).then(setRecording, (error: Error) => setProblem(error.message));
  }, [file]);
  const setMapping = (mapping: Mapping) => setRecording((before) => before && { ...before, mapping });
  return { recording, problem, setMapping };
}
