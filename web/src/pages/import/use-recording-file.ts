import { useEffect, useState } from "preact/hooks";
import type { FormatName } from "../../api/formats";
import { fileFormat, HEAD_BYTES } from "./file-format";
import { guessMapping, type Mapping } from "./mapping";
import { readTable, type Table } from "./table";
import { textOf } from "./text-of";

/** Largest file, bytes; also the default limit of the service. */
const MAX_BYTES = 64 << 20;

export interface RecordingFile {
  table: Table;
  mapping: Mapping;
}

/** A file that is opened: its format, and what it holds if that is a text. */
interface OpenedFile {
  format: FormatName;
  recording?: RecordingFile;
}

const bytesOf = async (file: Blob) => new Uint8Array(await file.arrayBuffer());

async function open(file: File): Promise<OpenedFile> {
  if (file.size > MAX_BYTES) throw new Error("The file is larger than 64 MiB. Split it.");
  const format = fileFormat(await bytesOf(file.slice(0, HEAD_BYTES)));
  if (format !== "csv") return { format };
  const table = readTable(textOf(await bytesOf(file)));
  return { format, recording: { table, mapping: guessMapping(table) } };
}

/**
 * Opens a file. A text is read as a table with an editable mapping, another format is left to the service.
 * Returns nothing while it is being read, and the problem if it cannot be read.
 */
export function useRecordingFile(file: File) {
  const [opened, setOpened] = useState<OpenedFile>();
  const [problem, setProblem] = useState<string>();
  useEffect(() => {
    open(file).then(setOpened, (error: Error) => setProblem(error.message));
  }, [file]);
  const setMapping = (mapping: Mapping) =>
    setOpened((before) => before?.recording && { ...before, recording: { ...before.recording, mapping } });
  return { opened, problem, setMapping };
}
